// Load on the status server, in one thread so that it takes as little as it can from what it
// measures. Prints what it reached as JSON; tests/hil/server_load.py judges.
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kAskers = 20, kSlow = 20, kRude = 5;
constexpr int kMostConnecting = 64;
constexpr auto kDrip = std::chrono::milliseconds(200);
constexpr auto kPong = std::chrono::seconds(10);  // without being asked: RFC 6455, 5.5.3
constexpr auto kPatience = std::chrono::seconds(3);

struct Wanted {
    std::string host;
    int port = 0;
    double seconds = 0, requests_per_s = 0, connects_per_s = 0;
    int streams = 0, deaf = 0;
};

struct Reached {
    long asked = 0, answers = 0, refused = 0, connects = 0, connects_failed = 0, rude = 0,
         broken = 0;
    long streams = 0, stream_bytes = 0;
    std::vector<float> waits_ms;  ///< from the moment a request was due to its answer
};

enum class Kind { asker, stream, deaf, slow, rude, connect };

struct Connection {
    Kind kind = Kind::asker;
    int fd = -1;
    bool connected = false;
    std::string out;      ///< not taken by the socket yet
    std::string in;       ///< of an asker: the head as far as it has come
    long body_left = -1;  ///< of the answer; -1: in its head
    bool busy = false;
    Clock::time_point since;  ///< a request was due, a connection begun
};

class Load {
  public:
    explicit Load(Wanted wanted) : wanted_(std::move(wanted)), poll_(::epoll_create1(0)) {
        address_.sin_family = AF_INET;
        address_.sin_port = htons(static_cast<std::uint16_t>(wanted_.port));
        ::inet_pton(AF_INET, wanted_.host.c_str(), &address_.sin_addr);
        name_ = wanted_.host + ':' + std::to_string(wanted_.port);
    }

    const Reached& run() {
        for (int i = 0; i < wanted_.streams; ++i)
            open(i < wanted_.deaf ? Kind::deaf : Kind::stream);
        for (int i = 0; i < kAskers; ++i) open(Kind::asker);
        for (int i = 0; i < kSlow; ++i) open(Kind::slow);
        for (int i = 0; i < kRude; ++i) open(Kind::rude);
        start_ = Clock::now();
        const auto end = start_ + std::chrono::duration<double>(wanted_.seconds);
        auto drip = start_;
        std::array<epoll_event, 256> events{};
        for (auto now = start_; now < end; now = Clock::now()) {
            const int n = ::epoll_wait(poll_, events.data(), events.size(), 1);
            for (int i = 0; i < n; ++i) {
                const auto at =
                    static_cast<std::size_t>(events[static_cast<std::size_t>(i)].data.u32);
                if (connections_[at]->fd >= 0) ready(*connections_[at]);
            }
            const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
            ask(static_cast<long>(elapsed * wanted_.requests_per_s));
            connect_more(static_cast<long>(elapsed * wanted_.connects_per_s));
            if (now >= drip) {
                drip = now + kDrip;
                look_after_the_slow(now);
            }
        }
        for (const auto& connection : connections_) {
            const bool stream = connection->kind == Kind::stream || connection->kind == Kind::deaf;
            reached_.streams += stream && connection->fd >= 0 ? 1 : 0;
        }
        return reached_;
    }

  private:
    /// In the place of one that is over, or in a new one.
    void open(Kind kind, Connection* in_place_of = nullptr) {
        std::size_t at = connections_.size();
        if (in_place_of == nullptr && kind == Kind::connect && !free_.empty()) {
            at = free_.back();
            free_.pop_back();
        } else if (in_place_of != nullptr) {
            for (at = 0; connections_[at].get() != in_place_of; ++at) {
            }
        } else {
            connections_.push_back(std::make_unique<Connection>());
        }
        Connection& to = *connections_[at];
        to = {};
        to.kind = kind;
        to.since = Clock::now();
        to.fd = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        const int one = 1, little = 4096;
        ::setsockopt(to.fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        if (kind == Kind::deaf) ::setsockopt(to.fd, SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
        // Closed by a reset: thousands of closed connections would otherwise keep their ports.
        const linger at_once{1, 0};
        ::setsockopt(to.fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
        ::connect(to.fd, reinterpret_cast<const sockaddr*>(&address_), sizeof address_);
        epoll_event event{};
        event.events = EPOLLIN | EPOLLOUT | EPOLLRDHUP | EPOLLET;
        event.data.u32 = static_cast<std::uint32_t>(at);
        ::epoll_ctl(poll_, EPOLL_CTL_ADD, to.fd, &event);
        if (kind == Kind::stream || kind == Kind::deaf)
            to.out =
                "GET /api/v1/stream?rate_hz=5 HTTP/1.1\r\nHost: " + name_ +
                "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
        if (kind == Kind::rude) to.out = rudeness();
    }

    std::string rudeness() {
        switch (random_() % 4) {
            case 0:
                return "GET / HTTP/1.1\r\nX: " + std::string(100'000, 'a');
            case 1:
                return "POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nContent-Length: "
                       "99999999\r\n\r\n" +
                       std::string(50'000, '[');
            case 2:
                return "POST /api/v1/commands HTTP/1.1\r\nHost: " + name_ +
                       "\r\nContent-Type: application/json\r\nContent-Length: 8000\r\n\r\n" +
                       std::string(8000, '{');
            default: {
                std::string noise(2000, ' ');
                for (char& c : noise) c = static_cast<char>(random_());
                return noise;
            }
        }
    }

    void close(Connection& connection) {
        ::close(connection.fd);
        connection.fd = -1;
    }

    void ready(Connection& c) {
        if (!c.connected) {
            int error = 0;
            socklen_t size = sizeof error;
            ::getsockopt(c.fd, SOL_SOCKET, SO_ERROR, &error, &size);
            tcp_info info{};
            size = sizeof info;
            ::getsockopt(c.fd, IPPROTO_TCP, TCP_INFO, &info, &size);
            if (error == 0 && info.tcpi_state == TCP_SYN_SENT) return;
            if (error != 0) return over(c);
            c.connected = true;
        }
        if (c.kind == Kind::connect) return over(c);
        if (!flush(c)) return over(c);
        if (c.kind != Kind::deaf && !take(c)) over(c);
    }

    bool flush(Connection& c) {
        while (!c.out.empty()) {
            const ssize_t sent = ::send(c.fd, c.out.data(), c.out.size(), MSG_NOSIGNAL);
            if (sent < 0) return errno == EAGAIN;
            c.out.erase(0, static_cast<std::size_t>(sent));
        }
        return true;
    }

    /// Reads all there is; false: the other side has closed.
    bool take(Connection& c) {
        static std::array<char, 1 << 17> block;
        for (;;) {
            const ssize_t got = ::recv(c.fd, block.data(), block.size(), 0);
            if (got < 0) return errno == EAGAIN;
            if (got == 0) return false;
            if (c.kind == Kind::stream) reached_.stream_bytes += got;
            if (c.kind == Kind::asker) answer(c, {block.data(), static_cast<std::size_t>(got)});
        }
    }

    void answer(Connection& c, std::string_view text) {
        if (c.body_left < 0) {
            c.in += text;
            const std::size_t head = c.in.find("\r\n\r\n");
            if (head == std::string::npos) return;
            const std::size_t length = c.in.find("Content-Length: ");
            c.body_left = length == std::string::npos ? 0 : std::atol(c.in.c_str() + length + 16);
            c.body_left -= static_cast<long>(c.in.size() - head - 4);
            ++(c.in.compare(0, 12, "HTTP/1.1 200") == 0 ? reached_.answers : reached_.refused);
        } else {
            c.body_left -= static_cast<long>(text.size());
        }
        if (c.body_left > 0) return;
        reached_.waits_ms.push_back(
            std::chrono::duration<float, std::milli>(Clock::now() - c.since).count());
        c.in.clear();
        c.body_left = -1;
        c.busy = false;
    }

    void over(Connection& c) {
        const Kind kind = c.kind;
        close(c);
        if (kind == Kind::connect) {
            ++(c.connected ? reached_.connects : reached_.connects_failed);
            --connecting_;
            for (std::size_t at = 0; at < connections_.size(); ++at)
                if (connections_[at].get() == &c) free_.push_back(at);
            return;
        }
        // The server may close on the deaf, the slow and the rude; on the others it must not.
        if (kind == Kind::asker || kind == Kind::stream) ++reached_.broken;
        if (kind == Kind::rude) ++reached_.rude;
        open(kind, &c);
    }

    /// In turn, so that none is idle for long.
    void ask(long due) {
        for (std::size_t i = 0; i < connections_.size() && reached_.asked < due; ++i) {
            next_ = (next_ + 1) % connections_.size();
            Connection& c = *connections_[next_];
            if (c.kind != Kind::asker || c.busy || !c.connected) continue;
            c.busy = true;
            c.since =
                start_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
                             static_cast<double>(reached_.asked) / wanted_.requests_per_s));
            ++reached_.asked;
            c.out = "GET /api/v1/status HTTP/1.1\r\nHost: " + name_ + "\r\n\r\n";
            if (!flush(c)) over(c);
        }
    }

    void connect_more(long due) {
        while (begun_ < due && connecting_ < kMostConnecting) {
            ++begun_;
            ++connecting_;
            open(Kind::connect);
        }
    }

    void look_after_the_slow(Clock::time_point now) {
        for (const auto& connection : connections_) {
            Connection& c = *connection;
            if (c.fd < 0) continue;
            if (c.kind == Kind::stream && c.connected && now - c.since > kPong) {
                c.since = now;
                c.out += std::string("\x8A\x80\0\0\0\0", 6);  // masked, empty
                if (!flush(c)) over(c);
            } else if (c.kind == Kind::slow && c.connected &&
                       ::send(c.fd, "G", 1, MSG_NOSIGNAL) < 0 && errno != EAGAIN) {
                over(c);
            } else if (c.kind == Kind::rude && now - c.since > kPatience) {
                over(c);
            }
        }
    }

    const Wanted wanted_;
    const int poll_;
    sockaddr_in address_{};
    std::string name_;
    Clock::time_point start_;
    std::vector<std::unique_ptr<Connection>> connections_;
    std::vector<std::size_t> free_;
    std::size_t next_ = 0;
    long begun_ = 0;
    int connecting_ = 0;
    std::mt19937 random_{20090401};
    Reached reached_;
};

/// Seconds this process was ready to run and had no processor; negative: the kernel does not say.
double waited_s() {
    double run = 0, waited = -1e9;
    if (FILE* const file = std::fopen("/proc/self/schedstat", "r"); file != nullptr) {
        if (std::fscanf(file, "%lf %lf", &run, &waited) != 2) waited = -1e9;
        std::fclose(file);
    }
    return waited / 1e9;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 8) {
        std::fprintf(stderr,
                     "usage: %s ADDRESS PORT SECONDS STREAMS DEAF REQUESTS_PER_S CONNECTS_PER_S\n",
                     argv[0]);
        return 2;
    }
    Wanted wanted;
    wanted.host = argv[1];
    wanted.port = std::atoi(argv[2]);
    wanted.seconds = std::atof(argv[3]);
    wanted.streams = std::atoi(argv[4]);
    wanted.deaf = std::atoi(argv[5]);
    wanted.requests_per_s = std::atof(argv[6]);
    wanted.connects_per_s = std::atof(argv[7]);
    Load load(wanted);
    Reached reached = load.run();
    std::sort(reached.waits_ms.begin(), reached.waits_ms.end());
    const auto part = [&](double p) {
        const auto& w = reached.waits_ms;
        return w.empty() ? 0.0
                         : static_cast<double>(
                               w[static_cast<std::size_t>(p * static_cast<double>(w.size() - 1))]);
    };
    rusage used{};
    ::getrusage(RUSAGE_SELF, &used);
    const double cpu = static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                       static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec) / 1e6;
    std::printf(
        "{\"asked\":%ld,\"answers\":%ld,\"refused\":%ld,\"connects\":%ld,\"connects_failed\":%ld,"
        "\"rude\":%ld,"
        "\"broken\":%ld,\"streams\":%ld,\"stream_bytes\":%ld,\"wait_p50_ms\":%.3f,\"wait_p99_ms\":%"
        ".3f,"
        "\"cpu_s\":%.3f,\"waited_s\":%.3f}\n",
        reached.asked, reached.answers, reached.refused, reached.connects, reached.connects_failed,
        reached.rude, reached.broken, reached.streams, reached.stream_bytes, part(0.5), part(0.99),
        cpu, waited_s());
    return 0;
}
