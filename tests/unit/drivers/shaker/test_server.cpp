#include "test_server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <modbus/modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <stdexcept>

namespace vibrig::drivers::test {
namespace {

using std::chrono::steady_clock;

constexpr int kReportServerId = 17;

int checked(int result, const char* what) {
    if (result < 0) throw std::runtime_error(std::string("test server: ") + what);
    return result;
}

int listen_on(int port, int& bound) {
    const int socket = checked(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket");
    const int on = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    checked(::bind(socket, generic, size), "bind");
    checked(::listen(socket, 8), "listen");
    checked(::getsockname(socket, generic, &size), "getsockname");
    bound = ntohs(address.sin_port);
    return socket;
}

/// A pty whose far end stays open and raw, so that the near end never hangs up.
int open_line(std::string& device, int& slave) {
    const int master = checked(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC), "posix_openpt");
    checked(::grantpt(master), "grantpt");
    checked(::unlockpt(master), "unlockpt");
    std::array<char, 128> name{};
    checked(-::ptsname_r(master, name.data(), name.size()), "ptsname_r");
    device = name.data();
    slave = checked(::open(device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC), "open pty");
    termios settings{};
    ::tcgetattr(slave, &settings);
    ::cfmakeraw(&settings);
    ::tcsetattr(slave, TCSANOW, &settings);
    return master;
}

void send_all(int client, std::span<const std::uint8_t> bytes, Answer answer) {
    if (answer.kind != Answer::Kind::bytewise) {
        static_cast<void>(!::write(client, bytes.data(), bytes.size()));
        return;
    }
    for (const std::uint8_t& byte : bytes) {
        if (::write(client, &byte, 1) != 1) return;
        std::this_thread::sleep_for(answer.delay);
    }
}

}  // namespace

TestServer::TestServer(Line line, int port) : line_(line) {
    event_ = checked(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), "eventfd");
    checked(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pipe_), "socketpair");
    if (line == Line::tcp) {
        listener_ = listen_on(port, port_);
        context_ = modbus_new_tcp("127.0.0.1", port_);
    } else {
        clients_.push_back(open_line(device_, slave_));
        context_ = modbus_new_rtu(device_.c_str(), 19200, 'E', 8, 1);
    }
    modbus_set_slave(context_, 1);
    mapping_ = modbus_mapping_new(0, 0, 16, 512);
    connection_of_.resize(4096);
    ::signal(SIGPIPE, SIG_IGN);
    thread_ = std::thread([this] { run(); });
}

TestServer::~TestServer() {
    quit_ = true;
    ::eventfd_write(event_, 1);
    thread_.join();
    for (const int client : clients_) ::close(client);
    for (const int fd : {listener_, event_, slave_, pipe_[0], pipe_[1]}) {
        if (fd >= 0) ::close(fd);
    }
    modbus_set_socket(context_, -1);
    modbus_free(context_);
    modbus_mapping_free(mapping_);
}

void TestServer::script(Script script) {
    const std::lock_guard lock(mutex_);
    script_ = std::move(script);
}

std::vector<Request> TestServer::requests() const {
    const std::lock_guard lock(mutex_);
    return requests_;
}

std::vector<Request> TestServer::writes() const {
    std::vector<Request> writes = requests();
    std::erase_if(writes, [](const Request& r) { return !r.is_write(); });
    return writes;
}

void TestServer::forget() {
    const std::lock_guard lock(mutex_);
    requests_.clear();
}

std::uint16_t TestServer::holding(int address) const {
    const std::lock_guard lock(mutex_);
    return mapping_->tab_registers[address];
}

void TestServer::set_holding(int address, std::uint16_t value) {
    const std::lock_guard lock(mutex_);
    mapping_->tab_registers[address] = value;
}

void TestServer::set_input(int address, std::uint16_t value) {
    const std::lock_guard lock(mutex_);
    mapping_->tab_input_registers[address] = value;
}

void TestServer::identify_as(std::string name) {
    const std::lock_guard lock(mutex_);
    identity_ = std::move(name);
}

bool TestServer::saw(const std::function<bool(const Request&)>& wanted) const {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(60),
                             [&] { return std::ranges::any_of(requests_, wanted); });
}

int TestServer::next_timeout_ms() const {
    if (delayed_.empty()) return -1;
    const auto due = std::ranges::min_element(delayed_, {}, &Delayed::due)->due;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - steady_clock::now());
    return static_cast<int>(std::max<std::int64_t>(0, left.count()));
}

void TestServer::send_delayed() {
    std::erase_if(delayed_, [](const Delayed& delayed) {
        if (delayed.due > steady_clock::now()) return false;
        send_all(delayed.client, delayed.bytes, {});
        return true;
    });
}

void TestServer::run() {
    while (!quit_) {
        std::vector<pollfd> events{{event_, POLLIN, 0}};
        if (listener_ >= 0) events.push_back({listener_, POLLIN, 0});
        for (const int client : clients_) events.push_back({client, POLLIN, 0});
        ::poll(events.data(), events.size(), next_timeout_ms());
        send_delayed();
        for (const pollfd& event : events) {
            if (event.revents == 0 || event.fd == event_) continue;
            if (event.fd == listener_) {
                const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
                if (client < 0) continue;
                const int on = 1;
                ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
                clients_.push_back(client);
                connection_of_[static_cast<std::size_t>(client)] = ++connections_;
            } else {
                serve(event.fd);
            }
        }
    }
}

void TestServer::drop(int client) {
    if (line_ == Line::rtu) return;
    std::erase(clients_, client);
    std::erase_if(delayed_, [&](const Delayed& delayed) { return delayed.client == client; });
    ::close(client);
}

Request TestServer::decode(std::span<const std::uint8_t> query, int client) const {
    const auto header = static_cast<std::size_t>(modbus_get_header_length(context_));
    const auto word = [&](std::size_t at) {
        return query[header + at] << 8 | query[header + at + 1];
    };
    Request request;
    request.function = query[header];
    request.connection = connection_of_[static_cast<std::size_t>(client)];
    if (request.function == kReportServerId) return request;  // that is all of it
    request.address = word(1);
    request.count = request.function == 6 ? 1 : word(3);
    const std::size_t first = request.function == 6 ? 3 : 6;
    for (std::size_t i = 0; request.is_write() && i < static_cast<std::size_t>(request.count);
         ++i) {
        request.values.push_back(static_cast<std::uint16_t>(word(first + 2 * i)));
    }
    return request;
}

std::vector<std::uint8_t> TestServer::reply_to(std::span<const std::uint8_t> query,
                                               const Answer& answer) {
    if (query[7] == kReportServerId && !identity_.empty() &&
        answer.kind != Answer::Kind::exception) {
        std::vector<std::uint8_t> bytes(query.begin(), query.begin() + 8);
        bytes.push_back(static_cast<std::uint8_t>(identity_.size() + 1));
        bytes.insert(bytes.end(), identity_.begin(), identity_.end());
        bytes.push_back(0xff);  // it runs
        bytes[5] = static_cast<std::uint8_t>(bytes.size() - 6);
        return bytes;
    }
    modbus_set_socket(context_, pipe_[0]);
    if (answer.kind == Answer::Kind::exception) {
        modbus_reply_exception(context_, query.data(), static_cast<unsigned>(answer.code));
    } else {
        modbus_reply(context_, query.data(), static_cast<int>(query.size()), mapping_);
    }
    std::vector<std::uint8_t> bytes(512);
    bytes.resize(static_cast<std::size_t>(
        checked(static_cast<int>(::recv(pipe_[1], bytes.data(), bytes.size(), 0)), "recv")));
    return bytes;
}

/// The little of a shaker that matters here: it follows its set-point at once.
void TestServer::react(const Request& request) {
    if (!request.is_write()) return;
    const auto* const holding = mapping_->tab_registers;
    auto* const input = mapping_->tab_input_registers;
    const bool run = holding[5] != 0;
    input[0] = run ? 2 : 0;
    input[3] = run ? holding[2] : std::uint16_t{0};
    input[4] = run ? holding[3] : std::uint16_t{0};
}

void TestServer::serve(int client) {
    std::array<std::uint8_t, MODBUS_MAX_ADU_LENGTH> buffer{};
    modbus_set_socket(context_, client);
    const int length = modbus_receive(context_, buffer.data());
    if (length < 0) return drop(client);
    if (length == 0) return;  // for another unit
    const auto query =
        std::span<const std::uint8_t>(buffer).first(static_cast<std::size_t>(length));
    const Request request = decode(query, client);
    Answer answer;
    std::vector<std::uint8_t> bytes;
    {
        const std::lock_guard lock(mutex_);
        if (script_) answer = script_(request);
        std::array<std::uint16_t, 16> before{};
        std::copy_n(mapping_->tab_registers, before.size(), before.begin());
        bytes = reply_to(query, answer);
        if (answer.kind == Answer::Kind::ignore_write || answer.kind == Answer::Kind::swallow) {
            std::ranges::copy(before, mapping_->tab_registers);
        } else if (answer.kind != Answer::Kind::exception) {
            if (answer.kind == Answer::Kind::trip) mapping_->tab_registers[5] = 0;
            react(request);
        }
        requests_.push_back(request);
    }
    changed_.notify_all();
    const auto header = static_cast<std::size_t>(modbus_get_header_length(context_));
    switch (answer.kind) {
        case Answer::Kind::hang:
        case Answer::Kind::swallow:
            return;
        case Answer::Kind::close:
            return drop(client);
        case Answer::Kind::late:
            delayed_.push_back({steady_clock::now() + answer.delay, client, bytes});
            return;
        case Answer::Kind::half_then_close:
            bytes.resize(bytes.size() / 2);
            send_all(client, bytes, answer);
            return drop(client);
        case Answer::Kind::twice:
            send_all(client, bytes, answer);
            break;
        case Answer::Kind::wrong_transaction:
            bytes[1] ^= 0x55;
            break;
        case Answer::Kind::wrong_unit:
            bytes[header - 1] ^= 0x02;
            break;
        case Answer::Kind::wrong_function:
            bytes[header] = bytes[header] == 3 ? 4 : 3;
            break;
        case Answer::Kind::wrong_length:
            bytes[header + 1] = static_cast<std::uint8_t>(bytes[header + 1] - 2);
            break;
        case Answer::Kind::damaged:
            bytes.back() ^= 0xff;
            break;
        case Answer::Kind::normal:
        case Answer::Kind::exception:
        case Answer::Kind::ignore_write:
        case Answer::Kind::trip:
        case Answer::Kind::bytewise:
            break;
    }
    send_all(client, bytes, answer);
}

}  // namespace vibrig::drivers::test
