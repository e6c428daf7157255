#include "daemon/guard/modbus_tcp.hpp"

#include <modbus/modbus.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "daemon/guard/settings.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig::guard {

namespace {

std::string error_words(int error) { return std::generic_category().message(error); }

/// -1: none within the time, `why` says it.
int connected_socket(const addrinfo& to, int wait_ms, std::string& why) {
    const int socket = ::socket(to.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (socket < 0) {
        why = "no socket: " + error_words(errno);
        return -1;
    }
    const int on = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    int error = ::connect(socket, to.ai_addr, to.ai_addrlen) == 0 ? 0 : errno;
    if (error == EINPROGRESS) {
        pollfd writable{socket, POLLOUT, 0};
        socklen_t size = sizeof error;
        if (::poll(&writable, 1, wait_ms) <= 0) {
            error = ETIMEDOUT;
        } else if (::getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size) != 0) {
            error = errno;
        }
    }
    if (error == 0) return socket;
    ::close(socket);
    why = error_words(error);
    return -1;
}

}  // namespace

void ModbusTcp::FreeModbus::operator()(_modbus* context) const noexcept { modbus_free(context); }
void ModbusTcp::FreeAddresses::operator()(addrinfo* addresses) const noexcept {
    ::freeaddrinfo(addresses);
}

ModbusTcp::ModbusTcp(std::string host, int port, int unit, int wait_ms)
    : host_(std::move(host)),
      port_(port),
      wait_ms_(wait_ms),
      name_(host_ + ":" + std::to_string(port)) {
    // The address given here is not used: sockets are connected with a deadline.
    context_.reset(modbus_new_tcp("127.0.0.1", port));
    if (!context_ || modbus_set_slave(context_.get(), unit) != 0)
        throw SettingsError("libmodbus refuses " + name_ + ", unit " + std::to_string(unit));
    modbus_set_error_recovery(context_.get(), MODBUS_ERROR_RECOVERY_NONE);
    wait_as_ever();
    modbus_set_byte_timeout(context_.get(), 0, 0);  // the response timeout covers the whole reply
}

ModbusTcp::~ModbusTcp() { close(); }

void ModbusTcp::wait_for_ms(int time) noexcept {
    const auto ms = static_cast<std::uint32_t>(time);
    modbus_set_response_timeout(context_.get(), ms / 1000, ms % 1000 * 1000);
}

bool ModbusTcp::resolve() {
    if (addresses_) return true;
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    const int error = ::getaddrinfo(host_.c_str(), std::to_string(port_).c_str(), &hints, &found);
    if (error != 0) return lose(::gai_strerror(error));
    addresses_.reset(found);
    return true;
}

void ModbusTcp::close() noexcept {
    if (!connected_) return;
    const linger forget{1, 0};
    ::setsockopt(modbus_get_socket(context_.get()), SOL_SOCKET, SO_LINGER, &forget, sizeof forget);
    modbus_close(context_.get());
    connected_ = false;
}

bool ModbusTcp::lose(const std::string& what) {
    note_ = name_ + ": " + what;
    close();
    return false;
}

void ModbusTcp::is_well() {
    note_.clear();
    answered_ = address_;
}

std::vector<const addrinfo*> ModbusTcp::in_turn() const {
    std::vector<const addrinfo*> all;
    for (const addrinfo* one = addresses_.get(); one != nullptr; one = one->ai_next)
        all.insert(one == answered_ ? all.begin() : all.end(), one);
    return all;
}

bool ModbusTcp::connect() {
    if (!resolve()) return false;
    const auto all = in_turn();
    const drivers::Time until = drivers::steady_now() + wait_ms_ * drivers::kMillisecond;
    auto left = static_cast<drivers::Time>(all.size());
    std::string why;
    for (const addrinfo* const one : all) {
        // One that swallows what comes leaves the others their part.
        const drivers::Time part = (until - drivers::steady_now()) / left--;
        const int socket = connected_socket(
            *one, static_cast<int>(std::max<drivers::Time>(part, 0) / drivers::kMillisecond), why);
        if (socket < 0) continue;
        modbus_set_socket(context_.get(), socket);
        address_ = one;
        return connected_ = true;
    }
    return lose(why);
}

}  // namespace vibrig::guard
