// CAN ports under load: what was sent is received in order, or counted as lost, to the frame. Every
// frame carries its number on its bus. The vcan tests run where vcan0 and vcan1 are; VIBRIG_LOAD_S
// says how long each load lasts.
#include <gtest/gtest.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <future>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "drivers/can/can_port.hpp"

namespace vibrig::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr canid_t kNumbered = 0x6F0;
constexpr double kSeqpacketRate = 9'000;  ///< frames/s
constexpr double kFirstRate = 1'000;      ///< frames/s on each bus, doubled while none is lost
constexpr double kHighestRate = 64'000;   ///< and that is enough
constexpr double kShare = 0.6;            ///< of the highest rate seen: what is stated
constexpr auto kTick = 2ms;               ///< of the sender; a kernel with HZ=100 makes it 10 ms
constexpr double kRoom = 100;  ///< frames: less than half of what a socket's default buffer holds

double load_seconds() {
    const char* text = std::getenv("VIBRIG_LOAD_S");
    return text == nullptr ? 2 : std::atof(text);
}

/// Sends numbered frames.
class Sender {
  public:
    explicit Sender(int fd) : fd_(fd) {}
    ~Sender() { ::close(fd_); }
    Sender(const Sender&) = delete;
    Sender& operator=(const Sender&) = delete;
    static std::unique_ptr<Sender> on(const std::string& interface) {
        const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
        EXPECT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);  // it does not listen
        return std::make_unique<Sender>(fd);
    }
    void send() {
        can_frame frame{};
        frame.can_id = kNumbered;
        frame.can_dlc = 8;
        std::memcpy(frame.data, &sent, sizeof sent);
        ASSERT_EQ(::send(fd_, &frame, sizeof frame, 0), static_cast<ssize_t>(sizeof frame));
        ++sent;
    }
    std::uint64_t sent = 0;

  private:
    int fd_;
};

/// A port in a thread of its own, and what its frames' numbers say.
class Receiver {
  public:
    explicit Receiver(const drivers::CanPortSettings& settings)
        : work_(boost::asio::make_work_guard(io_)), port_(drivers::make_can_port(io_, settings)) {
        port_->start(
            [this](std::span<const drivers::ReceivedFrame> frames) {
                for (const auto& f : frames) take(f.frame);
            },
            [](drivers::PortState, const char*) {}, [](const drivers::ReceivedFrame&) {});
        thread_ = std::thread([this] { io_.run(); });
    }
    ~Receiver() {
        boost::asio::post(io_, [this] {
            port_->stop();
            work_.reset();
        });
        thread_.join();
    }
    Receiver(const Receiver&) = delete;
    Receiver& operator=(const Receiver&) = delete;

    /// Reads nothing until the promise is kept.
    void hold(std::future<void> until) {
        std::promise<void> holds;
        auto held = holds.get_future();
        boost::asio::post(io_,
                          [&holds, until = std::make_shared<std::future<void>>(std::move(until))] {
                              holds.set_value();
                              until->wait();
                          });
        held.wait();
    }
    [[nodiscard]] drivers::CanPortCounters counters() const { return port_->counters(); }

    /// Everything was received once the frame sent last is: it also brings the kernel's count of
    /// what it dropped.
    void wait_for_last_of(Sender& sender) const {
        const auto give_up = Clock::now() + 30s;
        while (next != sender.sent && Clock::now() < give_up) {
            // It may have been dropped itself.
            if (quiet()) sender.send();
            std::this_thread::sleep_for(20ms);
        }
        EXPECT_EQ(next, sender.sent);
    }

    std::atomic<std::uint64_t> next = 0;  ///< number expected
    std::atomic<std::uint64_t> missing = 0, misplaced = 0;

  private:
    bool quiet() const {
        const auto before = counters().received;
        std::this_thread::sleep_for(50ms);
        return counters().received == before;
    }
    void take(const canfd_frame& frame) {
        if (frame.can_id != kNumbered) return;
        std::uint64_t number = 0;
        std::memcpy(&number, frame.data, sizeof number);
        if (number < next) {
            ++misplaced;
            return;
        }
        missing += number - next;
        next = number + 1;
    }

    boost::asio::io_context io_;
    boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
    std::unique_ptr<drivers::CanPort> port_;
    std::thread thread_;
};

/// sent = delivered + dropped, and the numbers in the frames say the same.
void expect_balance(const Sender& sender, const Receiver& receiver, const std::string& bus) {
    const auto c = receiver.counters();
    EXPECT_EQ(c.received, c.delivered + c.own + c.error_frames + c.malformed) << bus;
    EXPECT_EQ(c.delivered + c.kernel_dropped, sender.sent) << bus;
    EXPECT_EQ(c.kernel_dropped, receiver.missing) << bus;
    EXPECT_EQ(receiver.misplaced, 0u) << bus;
}

/// So many frames a second to each sender, and no more at once: a late sender makes up for less.
/// Returns the rate that came of it, frames/s.
double send_at(double rate, double seconds, double most_at_once,
               const std::vector<Sender*>& senders) {
    const std::chrono::duration<double> length(seconds);
    const auto begin = Clock::now();
    auto last = begin;
    double due = 0;
    std::uint64_t count = 0;
    while (last - begin < length) {
        std::this_thread::sleep_for(kTick);
        const auto now = Clock::now();
        due =
            std::min(due + rate * std::chrono::duration<double>(now - last).count(), most_at_once);
        last = now;
        for (; due >= 1; --due, ++count)
            for (Sender* sender : senders) sender->send();
    }
    return static_cast<double>(count) / std::chrono::duration<double>(Clock::now() - begin).count();
}

class VcanLoad : public ::testing::Test {
  protected:
    void SetUp() override {
        if (::if_nametoindex("vcan0") == 0 || ::if_nametoindex("vcan1") == 0)
            GTEST_SKIP() << "there are no vcan0 and vcan1 here";
    }
    static drivers::CanPortSettings settings(const std::string& interface,
                                             int receive_buffer = 1 << 20) {
        drivers::CanPortSettings s;
        s.interface = interface;
        s.receive_buffer = receive_buffer;
        return s;
    }
};

TEST_F(VcanLoad, TwoBusesLoseNothingUpToTheStatedRate) {
    Receiver first(settings("vcan0")), second(settings("vcan1"));
    const auto one = Sender::on("vcan0"), two = Sender::on("vcan1");
    const auto settle = [&] {
        first.wait_for_last_of(*one);
        second.wait_for_last_of(*two);
    };
    // GIVEN the highest rate that this kernel sustains for a second
    double sustained = 0;
    for (double rate = kFirstRate; rate <= kHighestRate; rate *= 2) {
        const auto before = first.missing + second.missing;
        const double reached = send_at(rate, 1, kRoom, {one.get(), two.get()});
        settle();
        if (first.missing + second.missing > before) break;
        sustained = std::max(sustained, reached);
        if (reached < 0.9 * rate) break;
    }
    ASSERT_GT(sustained, 0) << "frames are lost at " << kFirstRate << " frames/s on each bus";
    // WHEN it sends at the rate that is stated
    const auto lost = first.missing + second.missing;
    const double rate = send_at(kShare * sustained, load_seconds(), kRoom, {one.get(), two.get()});
    settle();
    std::cout << "# two vcan buses: " << std::lround(sustained) << " frames/s each for a second, "
              << std::lround(rate) << " frames/s each for " << load_seconds()
              << " s: " << one->sent + two->sent << " frames\n";
    // THEN none is lost, and the balances close over all of it
    EXPECT_EQ(first.missing + second.missing, lost);
    expect_balance(*one, first, "vcan0");
    expect_balance(*two, second, "vcan1");
}

TEST_F(VcanLoad, ABurstIntoASmallReceiveBufferIsCountedExactly) {
    // GIVEN a receiver with room for a few frames that does not read
    Receiver receiver(settings("vcan0", 4096));
    const auto sender = Sender::on("vcan0");
    for (int i = 0; i < 100; ++i) sender->send();
    receiver.wait_for_last_of(*sender);
    std::promise<void> go_on;
    receiver.hold(go_on.get_future());
    // WHEN 10 000 frames come at once
    for (int i = 0; i < 10'000; ++i) sender->send();
    go_on.set_value();
    receiver.wait_for_last_of(*sender);
    // THEN most are lost, as many as are counted, and it goes on
    std::cout << "# burst into 4096 bytes: " << receiver.missing << " of " << sender->sent
              << " frames lost, as many as counted\n";
    EXPECT_GT(receiver.missing, 9'000u);
    expect_balance(*sender, receiver, "vcan0");
    const auto lost = receiver.missing.load();
    for (int i = 0; i < 5; ++i) {
        sender->send();
        receiver.wait_for_last_of(*sender);
    }
    EXPECT_EQ(receiver.missing, lost);
    expect_balance(*sender, receiver, "vcan0");
}

TEST(SeqpacketLoad, NineThousandFramesASecondLoseNothing) {
    // GIVEN a bus over a socket; who sends waits where there is no room
    const std::string name = "vibrig-load-" + std::to_string(::getpid());
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data(), name.size());
    const int listener = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    ASSERT_EQ(::bind(listener, reinterpret_cast<const sockaddr*>(&address), size), 0);
    ASSERT_EQ(::listen(listener, 1), 0);
    drivers::CanPortSettings settings;
    settings.kind = drivers::CanPortSettings::Kind::seqpacket;
    settings.path = "@" + name;
    Receiver receiver(settings);
    Sender sender(::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC));
    ::close(listener);
    // WHEN it is loaded
    const double rate = send_at(kSeqpacketRate, load_seconds(), kSeqpacketRate, {&sender});
    receiver.wait_for_last_of(sender);
    std::cout << "# seqpacket: " << std::lround(rate) << " frames/s for " << load_seconds()
              << " s: " << sender.sent << " frames\n";
    // THEN nothing is lost
    EXPECT_EQ(receiver.missing, 0u);
    expect_balance(sender, receiver, "seqpacket");
}

}  // namespace
}  // namespace vibrig::test
