#include "drivers/shaker/modbus_link.hpp"

#include <fcntl.h>
#include <modbus/modbus.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <system_error>

namespace vibrig::drivers {
namespace {

[[nodiscard]] std::string error_text(int error) { return std::generic_category().message(error); }

/// Waits for a connect() under way. 0 or an errno.
[[nodiscard]] int finish_connect(int socket, Time timeout) noexcept {
    using std::chrono::steady_clock;
    const auto deadline = steady_clock::now() + std::chrono::nanoseconds(timeout);
    for (;;) {
        const auto left =
            std::chrono::ceil<std::chrono::milliseconds>(deadline - steady_clock::now());
        if (left.count() <= 0) return ETIMEDOUT;
        pollfd events{socket, POLLOUT, 0};
        const int ready = ::poll(&events, 1, static_cast<int>(left.count()));
        if (ready == 0) return ETIMEDOUT;
        if (ready < 0) {
            if (errno == EINTR) continue;
            return errno;
        }
        int error = 0;
        socklen_t size = sizeof error;
        if (::getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size) != 0) return errno;
        if (error == 0 && (events.revents & POLLHUP) != 0) return ECONNABORTED;
        return error;
    }
}

[[nodiscard]] std::string beyond_select(int descriptor) {
    return "descriptor " + std::to_string(descriptor) + " is not below " +
           std::to_string(FD_SETSIZE) +
           ", the limit of select() in libmodbus; fewer open files are needed";
}

}  // namespace

std::string Reply::text() const {
    switch (kind) {
        case ReplyKind::ok:
            return "done";
        case ReplyKind::exception:
            return "exception " + std::to_string(code) + " (" +
                   modbus_strerror(MODBUS_ENOBASE + code) + ")";
        case ReplyKind::timeout:
            return "no complete reply within the response timeout";
        case ReplyKind::wrong:
            return std::string("reply does not belong to the request (") + modbus_strerror(code) +
                   ")";
        case ReplyKind::lost:
            return "connection lost (" + error_text(code) + ")";
        case ReplyKind::overtaken:
            return "overtaken by a stop";
    }
    return "?";
}

void ModbusLink::FreeModbus::operator()(_modbus* context) const noexcept { modbus_free(context); }
void ModbusLink::FreeAddresses::operator()(addrinfo* addresses) const noexcept {
    ::freeaddrinfo(addresses);
}

ModbusLink::ModbusLink(const ShakerSettings& settings) : settings_(settings) {
    const bool tcp = settings.transport == ShakerSettings::Transport::tcp;
    name_ = tcp ? settings.host + ":" + std::to_string(settings.port) : settings.device;
    // The address given here is not used: sockets are connected with our own deadline.
    context_.reset(tcp ? modbus_new_tcp("127.0.0.1", settings.port)
                       : modbus_new_rtu(settings.device.c_str(), settings.baud, 'E', 8, 1));
    if (!context_) {
        throw ShakerError("shaker " + name_ + ": libmodbus refuses it: " + modbus_strerror(errno));
    }
    if (modbus_set_slave(context_.get(), settings.unit) != 0) {
        throw ShakerError("shaker.unit: must be a Modbus unit id, got " +
                          std::to_string(settings.unit));
    }
    modbus_set_error_recovery(context_.get(), MODBUS_ERROR_RECOVERY_NONE);
    respond_within(settings_.response_timeout);
    // Zero: the response timeout covers the whole reply. Any other value would start again with
    // every byte.
    modbus_set_byte_timeout(context_.get(), 0, 0);
    inert_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    cutter_ = inert_ < 0 ? -1 : ::fcntl(inert_, F_DUPFD_CLOEXEC, 0);
    if (cutter_ < 0) {
        const int error = errno;
        if (inert_ >= 0) ::close(inert_);
        throw ShakerError("shaker " + name_ + ": no descriptor: " + error_text(error));
    }
}

ModbusLink::~ModbusLink() {
    close();
    ::close(cutter_);
    ::close(inert_);
}

void ModbusLink::respond_within(Time timeout) noexcept {
    modbus_set_response_timeout(context_.get(), static_cast<std::uint32_t>(timeout / kSecond),
                                static_cast<std::uint32_t>(timeout % kSecond / kMicrosecond));
}

void ModbusLink::arm_cutter(int socket) noexcept {
    while (::dup3(socket, cutter_, O_CLOEXEC) < 0 && (errno == EINTR || errno == EBUSY)) {
    }
}

void ModbusLink::cut() noexcept { ::shutdown(cutter_, SHUT_RDWR); }

void ModbusLink::abort() noexcept {
    aborted_ = true;
    cut();
}

void ModbusLink::close() noexcept {
    arm_cutter(inert_);
    if (connected_ && settings_.transport == ShakerSettings::Transport::tcp) {
        // What has not been taken yet is forgotten: else the kernel would go on sending it by
        // itself and, when a cable is in again, deliver an old request after a new stop.
        const linger forget{1, 0};
        ::setsockopt(modbus_get_socket(context_.get()), SOL_SOCKET, SO_LINGER, &forget,
                     sizeof forget);
    }
    if (connected_) modbus_close(context_.get());
    connected_ = false;
}

ModbusLink::Connection ModbusLink::connect(std::string& why) {
    close();
    const auto result =
        settings_.transport == ShakerSettings::Transport::tcp ? connect_tcp(why) : connect_rtu(why);
    connected_ = result == Connection::open;
    return result;
}

ModbusLink::Connection ModbusLink::connect_tcp(std::string& why) {
    // Once: a lookup may hang for long, and none may stand between a stop and the shaker.
    if (!addresses_) {
        addrinfo hints{};
        hints.ai_family = AF_UNSPEC;
        hints.ai_socktype = SOCK_STREAM;
        hints.ai_flags = AI_NUMERICSERV;
        addrinfo* found = nullptr;
        const int error = ::getaddrinfo(settings_.host.c_str(),
                                        std::to_string(settings_.port).c_str(), &hints, &found);
        if (error != 0) {
            why = "cannot resolve " + settings_.host + ": " + ::gai_strerror(error);
            return Connection::failed;
        }
        addresses_.reset(found);
    }
    // The one that answered last is the first: a dead one before it would cost a stop the response
    // timeout.
    Connection result = Connection::failed;
    if (answered_ != nullptr) result = connect_address(*answered_, why);
    for (const addrinfo* address = addresses_.get();
         address != nullptr && result == Connection::failed; address = address->ai_next) {
        if (address != answered_) result = connect_address(*address, why);
    }
    return result;
}

ModbusLink::Connection ModbusLink::connect_address(const addrinfo& address, std::string& why) {
    const int socket = ::socket(address.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK,
                                address.ai_protocol);
    if (socket < 0) {
        why = "no socket: " + error_text(errno);
        return errno == EMFILE || errno == ENFILE ? Connection::out_of_descriptors
                                                  : Connection::failed;
    }
    if (socket >= FD_SETSIZE) {
        why = beyond_select(socket);
        ::close(socket);
        return Connection::out_of_descriptors;
    }
    const int on = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    int error = ::connect(socket, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
    arm_cutter(socket);
    if (aborted_) error = ECANCELED;  // after arming: an abort() from here on finds the socket
    if (error == EINPROGRESS || error == EINTR)
        error = finish_connect(socket, settings_.response_timeout);
    if (error != 0) {
        why = error == ETIMEDOUT ? "no connection within the response timeout" : error_text(error);
        arm_cutter(inert_);
        ::close(socket);
        return Connection::failed;
    }
    modbus_set_socket(context_.get(), socket);
    address_ = &address;
    return Connection::open;
}

ModbusLink::Connection ModbusLink::connect_rtu(std::string& why) {
    if (aborted_) {
        why = error_text(ECANCELED);
        return Connection::failed;
    }
    if (modbus_connect(context_.get()) != 0) {
        why = modbus_strerror(errno);
        return errno == EMFILE || errno == ENFILE ? Connection::out_of_descriptors
                                                  : Connection::failed;
    }
    const int descriptor = modbus_get_socket(context_.get());
    if (descriptor >= FD_SETSIZE) {
        why = beyond_select(descriptor);
        modbus_close(context_.get());
        return Connection::out_of_descriptors;
    }
    modbus_flush(context_.get());
    return Connection::open;
}

/// No connection, or something to read before anything was asked: the connection's end, or a reply
/// to a request given up.
Reply ModbusLink::hindered() noexcept {
    if (!connected_) return {ReplyKind::lost, ENOTCONN};
    pollfd events{modbus_get_socket(context_.get()), POLLIN, 0};
    if (::poll(&events, 1, 0) <= 0) return {};
    std::uint8_t byte = 0;
    if (settings_.transport == ShakerSettings::Transport::tcp &&
        ::recv(events.fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) <= 0) {
        return {ReplyKind::lost, ECONNRESET};
    }
    return {ReplyKind::wrong, EMBMDATA};
}

Reply ModbusLink::reply_of(int result, int expected, int error) noexcept {
    const bool exception = result < 0 && error > MODBUS_ENOBASE && error <= EMBXSBUSY;
    if (result == expected || exception) answered_ = address_;
    if (result == expected) return {};
    if (result >= 0) return {ReplyKind::wrong, EMBBADDATA};
    if (error == ETIMEDOUT) return {ReplyKind::timeout, error};
    if (exception) return {ReplyKind::exception, error - MODBUS_ENOBASE};
    if (error > MODBUS_ENOBASE) return {ReplyKind::wrong, error};
    return {ReplyKind::lost, error};
}

Reply ModbusLink::read(proto::RegisterTable table, std::uint16_t address,
                       std::span<std::uint16_t> words) noexcept {
    if (const Reply hindrance = hindered(); !hindrance.ok()) return hindrance;
    const int count = static_cast<int>(words.size());
    const int result =
        table == proto::RegisterTable::holding
            ? modbus_read_registers(context_.get(), address, count, words.data())
            : modbus_read_input_registers(context_.get(), address, count, words.data());
    return reply_of(result, count, errno);
}

Reply ModbusLink::write(std::uint16_t address, std::span<const std::uint16_t> words) noexcept {
    if (const Reply hindrance = hindered(); !hindrance.ok()) return hindrance;
    const int count = static_cast<int>(words.size());
    const int result = count == 1
                           ? modbus_write_register(context_.get(), address, words[0])
                           : modbus_write_registers(context_.get(), address, count, words.data());
    return reply_of(result, count, errno);
}

Reply ModbusLink::identify(std::string& text) noexcept {
    if (const Reply hindrance = hindered(); !hindrance.ok()) return hindrance;
    std::array<std::uint8_t, MODBUS_MAX_PDU_LENGTH> bytes{};
    const int result = modbus_report_slave_id(context_.get(), int(bytes.size()), bytes.data());
    if (result < 0) return reply_of(result, 0, errno);
    const auto end = bytes.begin() + std::min<std::ptrdiff_t>(result, std::ssize(bytes));
    text.clear();
    for (auto at = bytes.begin(); at != end && text.size() < 200; ++at)
        if (*at >= 0x20 && *at < 0x7f) text += static_cast<char>(*at);
    return {};
}

Reply ModbusLink::read_coil(std::uint16_t address, bool& on) noexcept {
    if (const Reply hindrance = hindered(); !hindrance.ok()) return hindrance;
    std::uint8_t bit = 0;
    const int result = modbus_read_bits(context_.get(), address, 1, &bit);
    on = bit != 0;
    return reply_of(result, 1, errno);
}

Reply ModbusLink::write_coil(std::uint16_t address, bool on) noexcept {
    if (const Reply hindrance = hindered(); !hindrance.ok()) return hindrance;
    const int result = modbus_write_bit(context_.get(), address, on ? 1 : 0);
    return reply_of(result, 1, errno);
}

}  // namespace vibrig::drivers
