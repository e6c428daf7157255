#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>

#include "tests/unit/drivers/can_port_suite.hpp"

namespace vibrig::test {
namespace {

constexpr const char* kInterface = "vcan0";

bool ip(const std::string& arguments) { return std::system(("ip " + arguments).c_str()) == 0; }

/// Another node on vcan0.
class VcanBus final : public TestBus {
  public:
    explicit VcanBus(int receive_buffer = 1 << 20) : receive_buffer_(receive_buffer) {
        VcanBus::bring_up();
    }
    ~VcanBus() override {
        if (fd_ >= 0) ::close(fd_);
        if (::if_nametoindex(kInterface) == 0)
            ip(std::string("link add ") + kInterface + " type vcan");
        ip(std::string("link set ") + kInterface + " mtu 72 up");
    }
    VcanBus(const VcanBus&) = delete;
    VcanBus& operator=(const VcanBus&) = delete;

    CanPortSettings settings() const override {
        CanPortSettings s;
        s.interface = kInterface;
        s.receive_buffer = receive_buffer_;
        return s;
    }
    void join() override {}
    bool send(std::span<const std::byte> packet) override {
        return ::send(fd_, packet.data(), packet.size(), 0) == static_cast<ssize_t>(packet.size());
    }
    std::vector<std::byte> receive() override {
        std::vector<std::byte> packet(CANFD_MTU);
        pollfd p{fd_, POLLIN, 0};
        if (::poll(&p, 1, 10'000) <= 0) return {};
        const ssize_t size = ::recv(fd_, packet.data(), packet.size(), 0);
        packet.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
        return packet;
    }
    void take_down() override { ASSERT_TRUE(ip(std::string("link set ") + kInterface + " down")); }
    void bring_up() override {
        ASSERT_TRUE(ip(std::string("link set ") + kInterface + " up"));
        if (fd_ >= 0) ::close(fd_);
        fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
        const int on = 1;
        ASSERT_EQ(::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on), 0);
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(::if_nametoindex(kInterface));
        ASSERT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    }
    /// Takes the interface away altogether.
    void remove() { ASSERT_TRUE(ip(std::string("link del ") + kInterface)); }
    /// A new interface of the same name: another index.
    void make_anew() {
        ASSERT_TRUE(ip(std::string("link add ") + kInterface + " type vcan"));
        ASSERT_TRUE(ip(std::string("link set ") + kInterface + " mtu 72"));
        bring_up();
    }

  private:
    int receive_buffer_;
    int fd_ = -1;
};

std::unique_ptr<TestBus> vcan() { return std::make_unique<VcanBus>(); }

/// The factory is called by SetUp, after this has had its say.
class NeedsVcan : public ::testing::Environment {
  public:
    void SetUp() override {
        if (::if_nametoindex(kInterface) == 0) GTEST_SKIP() << "there is no vcan0 here";
    }
};
const auto* const kNeedsVcan = ::testing::AddGlobalTestEnvironment(new NeedsVcan);

INSTANTIATE_TEST_SUITE_P(SocketCan, CanPortSuite, ::testing::Values(BusFactory(vcan)),
                         [](const auto&) { return std::string("vcan0"); });

/// What only the kernel's bus can do.
class SocketCanPort : public CanPortSuite {
  protected:
    VcanBus& vcan_bus() { return dynamic_cast<VcanBus&>(*bus_); }
};
INSTANTIATE_TEST_SUITE_P(SocketCan, SocketCanPort, ::testing::Values(BusFactory(vcan)),
                         [](const auto&) { return std::string("vcan0"); });

TEST_P(SocketCanPort, RecognisesItsOwnFrames) {
    start();
    // WHEN the port and another node send in turn
    for (std::uint64_t i = 0; i < 20; ++i) {
        ASSERT_TRUE(port_->send(make_frame(0x200, i), false));
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(0x100, i))));
    }
    ASSERT_TRUE(run_until([&] { return port_->counters().received == 40; }));
    // THEN its own frames are counted, and only the other's delivered
    EXPECT_EQ(port_->counters().own, 20u);
    ASSERT_EQ(frames_.size(), 20u);
    for (const ReceivedFrame& f : frames_) EXPECT_EQ(f.frame.can_id, 0x100u);
    expect_counters_close();
}

TEST_P(SocketCanPort, CountsExactlyWhatTheKernelDropped) {
    // GIVEN a port with a small receive buffer
    CanPortSettings settings = bus_->settings();
    settings.receive_buffer = 4096;
    port_ = drivers::make_can_port(io_, settings);
    start();
    // WHEN 2000 frames come while nobody reads, and one more after that
    for (std::uint64_t i = 0; i < 2000; ++i)
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, i))));
    std::uint64_t queued = 0;
    ASSERT_TRUE(run_until([&] {
        const bool same = queued == frames_.size() && queued > 0;
        queued = frames_.size();
        return same;
    }));
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 2000))));
    ASSERT_TRUE(run_until([&] { return frames_.size() == queued + 1; }));
    // THEN each is either delivered or counted as dropped
    EXPECT_LT(queued, 2000u);
    EXPECT_EQ(port_->counters().kernel_dropped + port_->counters().delivered, 2001u);
    // WHEN the last ones are dropped and no frame comes to tell, and the interface goes down
    for (std::uint64_t i = 0; i < 2000; ++i)
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, i))));
    bus_->take_down();
    ASSERT_TRUE(run_until([&] { return port_->state() != PortState::running; }));
    // THEN they are counted all the same
    EXPECT_EQ(port_->counters().kernel_dropped + port_->counters().delivered, 4001u);
    bus_->bring_up();
}

TEST_P(SocketCanPort, ComesBackAfterASecondDown) {
    start();
    bus_->take_down();
    ASSERT_TRUE(run_until([&] { return port_->state() == PortState::connecting; }));
    EXPECT_EQ(lines_.back(), "vcan0: down, waiting (ENETDOWN)");
    io_.restart();
    io_.run_for(std::chrono::seconds(1));
    bus_->bring_up();
    // THEN it runs again at its next look
    io_.restart();
    EXPECT_EQ(io_.run_one_for(std::chrono::seconds(10)), 1u);
    EXPECT_EQ(port_->state(), PortState::running);
    EXPECT_EQ(states_,
              (std::vector{PortState::running, PortState::connecting, PortState::running}));
}

TEST_P(SocketCanPort, BindsToAnInterfaceMadeAnew) {
    start();
    const unsigned before = ::if_nametoindex(kInterface);
    // WHEN the interface is deleted
    vcan_bus().remove();
    ASSERT_TRUE(run_until([&] { return port_->state() == PortState::absent; })) << lines_.back();
    EXPECT_FALSE(port_->send(make_frame(1, 1), false));
    io_.restart();
    EXPECT_LE(io_.run_for(std::chrono::milliseconds(500)), 5u);
    // AND made again
    vcan_bus().make_anew();
    ASSERT_NE(::if_nametoindex(kInterface), before);
    ASSERT_TRUE(run_until([&] { return port_->state() == PortState::running; }));
    // THEN frames come and go
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 9))));
    EXPECT_TRUE(run_until([&] { return frames_.size() == 1; }));
    EXPECT_TRUE(port_->send(make_frame(0x77, 3), false));
    EXPECT_EQ(bus_->receive().size(), CAN_MTU);
    for (std::size_t i = 1; i < states_.size(); ++i)
        EXPECT_NE(states_[i], states_[i - 1]) << lines_[i];
}

TEST_P(SocketCanPort, WaitsForAnInterfaceThatIsNotThereYet) {
    CanPortSettings settings = bus_->settings();
    settings.interface = "vcan7";
    port_ = drivers::make_can_port(io_, settings);
    start();
    EXPECT_EQ(port_->state(), PortState::absent);
    EXPECT_EQ(lines_.back(), "vcan7: no such interface, waiting (ENODEV)");
    ASSERT_TRUE(ip("link add vcan7 type vcan"));
    ASSERT_TRUE(run_until([&] { return port_->state() == PortState::connecting; }));
    ASSERT_TRUE(ip("link set vcan7 up"));
    EXPECT_TRUE(run_until([&] { return port_->state() == PortState::running; }));
    ASSERT_TRUE(ip("link del vcan7"));
}

}  // namespace
}  // namespace vibrig::test
