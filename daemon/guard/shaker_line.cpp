#include "daemon/guard/shaker_line.hpp"

#include <modbus/modbus.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace vibrig::guard {

namespace {

constexpr drivers::Time kPoll = drivers::kSecond / 2;
constexpr drivers::Time kPollWhileStopping = drivers::kSecond / 5;
constexpr drivers::Time kWait = drivers::kSecond / 2;  // of one request
constexpr int kWaitMs = 500;
constexpr drivers::Time kRetry = drivers::kSecond;
// What was read earlier is not known any more.
constexpr drivers::Time kFresh = 2 * drivers::kSecond;

std::string error_words(int error) { return std::generic_category().message(error); }

}  // namespace

void ShakerLine::FreeModbus::operator()(_modbus* context) const noexcept { modbus_free(context); }
void ShakerLine::FreeAddresses::operator()(addrinfo* addresses) const noexcept {
    ::freeaddrinfo(addresses);
}

ShakerLine::ShakerLine(const ShakerLineSettings& settings)
    : settings_(settings), name_(settings.host + ":" + std::to_string(settings.port)) {
    // The address given here is not used: sockets are connected with a deadline.
    context_.reset(modbus_new_tcp("127.0.0.1", settings.port));
    if (!context_ || modbus_set_slave(context_.get(), settings.unit) != 0)
        throw SettingsError("shaker: libmodbus refuses " + name_ + ", unit " +
                            std::to_string(settings.unit));
    modbus_set_error_recovery(context_.get(), MODBUS_ERROR_RECOVERY_NONE);
    modbus_set_response_timeout(context_.get(), 0,
                                static_cast<std::uint32_t>(kWait / drivers::kMicrosecond));
    modbus_set_byte_timeout(context_.get(), 0, 0);  // the response timeout covers the whole reply
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    const int error =
        ::getaddrinfo(settings.host.c_str(), std::to_string(settings.port).c_str(), &hints, &found);
    if (error != 0)
        throw std::runtime_error("shaker.host: found \"" + settings.host + "\" (" +
                                 ::gai_strerror(error) + "), expected a host that can be resolved");
    addresses_.reset(found);
}

ShakerLine::~ShakerLine() { close(); }

void ShakerLine::close() noexcept {
    if (!connected_) return;
    // What the kernel has not sent yet is forgotten: an order that comes late is none.
    const linger forget{1, 0};
    ::setsockopt(modbus_get_socket(context_.get()), SOL_SOCKET, SO_LINGER, &forget, sizeof forget);
    modbus_close(context_.get());
    connected_ = false;
}

bool ShakerLine::lose(const std::string& what) {
    note_ = name_ + ": " + what;
    close();
    return false;
}

bool ShakerLine::connect() {
    const addrinfo& to = *addresses_;
    const int socket = ::socket(to.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (socket < 0) return lose("no socket: " + error_words(errno));
    const int on = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    int error = ::connect(socket, to.ai_addr, to.ai_addrlen) == 0 ? 0 : errno;
    if (error == EINPROGRESS) {
        pollfd writable{socket, POLLOUT, 0};
        socklen_t size = sizeof error;
        if (::poll(&writable, 1, kWaitMs) <= 0) {
            error = ETIMEDOUT;
        } else if (::getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size) != 0) {
            error = errno;
        }
    }
    if (error != 0) {
        ::close(socket);
        return lose(error_words(error));
    }
    modbus_set_socket(context_.get(), socket);
    return connected_ = true;
}

bool ShakerLine::read(const proto::Register& reg, double& value) {
    std::array<std::uint16_t, 2> words{};
    const auto count = static_cast<int>(reg.words());
    const int got =
        reg.table == proto::RegisterTable::holding
            ? modbus_read_registers(context_.get(), reg.address, count, words.data())
            : modbus_read_input_registers(context_.get(), reg.address, count, words.data());
    if (got != count) return lose(std::string("cannot read: ") + modbus_strerror(errno));
    value = proto::decode(reg, {words.data(), reg.words()});
    return true;
}

bool ShakerLine::write_stop() {
    std::array<std::uint16_t, 2> words{};
    const auto count = static_cast<int>(settings_.run.words());
    // Other bits of the same register stay as they are.
    if (settings_.run.type == proto::RegisterType::bits &&
        modbus_read_registers(context_.get(), settings_.run.address, 1, words.data()) != 1)
        return lose(std::string("cannot read: ") + modbus_strerror(errno));
    if (!proto::encode(settings_.run, 0, {words.data(), settings_.run.words()})) return false;
    const int written =
        count == 1
            ? modbus_write_register(context_.get(), settings_.run.address, words[0])
            : modbus_write_registers(context_.get(), settings_.run.address, count, words.data());
    if (written != count) return lose(std::string("cannot write: ") + modbus_strerror(errno));
    ++stops_;
    return true;
}

void ShakerLine::step(drivers::Time now, bool stop) {
    // A stop that is new waits for no turn.
    if (stop && !stopping_) due_ = 0;
    stopping_ = stop;
    if (now < due_) return;
    due_ = now + (stop ? kPollWhileStopping : kRetry);
    if (!connected_ && !connect()) return;
    if (stop && !write_stop()) return;
    double run = 0, measured = 0;
    if (!read(settings_.run, run) || !read(settings_.measured_amplitude, measured)) return;
    word_ = {true, run != 0, measured};
    read_ = now;
    note_.clear();
    due_ = now + (stop ? kPollWhileStopping : kPoll);
}

ShakerWord ShakerLine::word(drivers::Time now) const {
    return read_ != 0 && now - read_ <= kFresh ? word_ : ShakerWord{};
}

}  // namespace vibrig::guard
