#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <filesystem>

#include "tests/unit/drivers/can_port_suite.hpp"

namespace vibrig::test {
namespace {

/// A hub with one client: the port under test.
class HubBus final : public TestBus {
  public:
    explicit HubBus(std::string path) : path_(std::move(path)) { HubBus::bring_up(); }
    ~HubBus() override { HubBus::take_down(); }
    HubBus(const HubBus&) = delete;
    HubBus& operator=(const HubBus&) = delete;

    CanPortSettings settings() const override {
        CanPortSettings s;
        s.kind = CanPortSettings::Kind::seqpacket;
        s.path = path_;
        return s;
    }
    void join() override {
        pollfd p{listener_, POLLIN, 0};
        ASSERT_GT(::poll(&p, 1, 10'000), 0) << "the port did not connect to " << path_;
        client_ = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
        ASSERT_GE(client_, 0);
    }
    bool send(std::span<const std::byte> packet) override {
        return ::send(client_, packet.data(), packet.size(), MSG_NOSIGNAL) ==
               static_cast<ssize_t>(packet.size());
    }
    std::vector<std::byte> receive() override {
        std::vector<std::byte> packet(256);
        pollfd p{client_, POLLIN, 0};
        if (::poll(&p, 1, 10'000) <= 0) return {};
        const ssize_t size = ::recv(client_, packet.data(), packet.size(), 0);
        packet.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
        return packet;
    }
    void take_down() override {
        for (int* fd : {&client_, &listener_}) {
            if (*fd >= 0) ::close(*fd);
            *fd = -1;
        }
        if (path_.front() == '/') std::filesystem::remove(path_);
    }
    void bring_up() override {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        path_.copy(address.sun_path, sizeof address.sun_path - 1);
        auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path_.size());
        if (path_.front() == '@')
            address.sun_path[0] = '\0';
        else
            ++length;
        listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
        ASSERT_EQ(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), length), 0)
            << path_;
        ASSERT_EQ(::listen(listener_, 4), 0);
    }

  private:
    std::string path_;
    int listener_ = -1;
    int client_ = -1;
};

std::string unique_name() {
    static int serial = 0;
    return "vibrig-test-" + std::to_string(::getpid()) + "-" + std::to_string(++serial);
}

std::unique_ptr<TestBus> abstract_hub() { return std::make_unique<HubBus>("@" + unique_name()); }
std::unique_ptr<TestBus> file_hub() {
    return std::make_unique<HubBus>(::testing::TempDir() + unique_name());
}

INSTANTIATE_TEST_SUITE_P(AbstractSocket, CanPortSuite, ::testing::Values(BusFactory(abstract_hub)),
                         [](const auto&) { return std::string("Hub"); });
INSTANTIATE_TEST_SUITE_P(SocketFile, CanPortSuite, ::testing::Values(BusFactory(file_hub)),
                         [](const auto&) { return std::string("Hub"); });

/// What only this kind of bus can do: carry packets that are no frames.
class SeqpacketPort : public CanPortSuite {};
INSTANTIATE_TEST_SUITE_P(AbstractSocket, SeqpacketPort, ::testing::Values(BusFactory(abstract_hub)),
                         [](const auto&) { return std::string("Hub"); });

TEST_P(SeqpacketPort, CountsPacketsThatAreNoFrames) {
    start();
    // WHEN packets of absurd sizes, an empty one, and lengths beyond the payload arrive among good
    // frames
    const std::vector<std::byte> junk(100, std::byte{0xFF});
    std::uint64_t bad = 0;
    for (const std::size_t size : {1u, 15u, 17u, 71u, 73u, 100u, 0u}) {
        ASSERT_TRUE(bus_->send(std::span(junk).first(size)));
        ++bad;
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, size))));
    }
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 0, 9))));
    ASSERT_TRUE(bus_->send(fd_packet(make_frame(1, 0, 65))));
    ASSERT_TRUE(bus_->send({}));
    bad += 3;
    // THEN they are counted, and the connection lives
    ASSERT_TRUE(run_until([&] { return port_->counters().received == 7 + bad; }));
    EXPECT_EQ(frames_.size(), 7u);
    EXPECT_EQ(port_->counters().malformed, bad);
    EXPECT_EQ(port_->state(), PortState::running);
    expect_counters_close();
}

TEST_P(SeqpacketPort, RefusesFdFramesWhereTheyAreSwitchedOff) {
    CanPortSettings settings = bus_->settings();
    settings.fd = false;
    port_ = drivers::make_can_port(io_, settings);
    start();
    ASSERT_TRUE(bus_->send(fd_packet(make_frame(1, 1))));
    ASSERT_TRUE(run_until([&] { return port_->counters().malformed == 1; }));
    EXPECT_FALSE(port_->send(make_frame(1, 1), true));
}

TEST_P(SeqpacketPort, KeepsWhatWasQueuedWhenTheHubDied) {
    start();
    // GIVEN 70 frames sent before the hub dies
    for (std::uint64_t i = 0; i < 70; ++i)
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, i))));
    bus_->take_down();
    // WHEN the port notices
    ASSERT_TRUE(run_until([&] { return port_->state() != PortState::running; }));
    // THEN it has delivered them all first, and the end of the connection is no packet
    EXPECT_EQ(frames_.size(), 70u);
    EXPECT_EQ(port_->counters().received, 70u);
}

TEST_P(SeqpacketPort, RefusesToSendWhenTheBusIsFull) {
    start();
    // GIVEN a hub that does not read
    std::uint64_t attempts = 0;
    // WHEN frames are sent until the kernel takes no more
    while (attempts < 1'000'000 && port_->send(make_frame(1, attempts++), false)) {
    }
    // THEN send() has not waited, and has counted the refusal
    EXPECT_LT(attempts, 1'000'000u);
    EXPECT_EQ(port_->counters().send_failed, 1u);
    EXPECT_EQ(port_->counters().sent, attempts - 1);
}

TEST(CanPortSettingsCheck, WaitsForAHubThatIsNotThereYet) {
    // GIVEN no hub
    boost::asio::io_context io;
    CanPortSettings settings;
    settings.kind = CanPortSettings::Kind::seqpacket;
    settings.path = "@" + unique_name();
    const auto port = drivers::make_can_port(io, settings);
    std::vector<std::string> lines;
    port->start(
        nullptr, [&](PortState, const char* text) { lines.emplace_back(text); }, nullptr);
    // THEN the port says so once and waits
    EXPECT_EQ(port->state(), PortState::absent);
    EXPECT_LE(io.run_for(std::chrono::milliseconds(250)), 3u);
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_EQ(lines[0], settings.path + ": nobody listens, waiting (ECONNREFUSED)");
    // WHEN the hub comes
    HubBus hub(settings.path);
    for (int i = 0; i < 100 && port->state() != PortState::running; ++i) {
        io.restart();
        io.run_one_for(std::chrono::milliseconds(100));
    }
    // THEN the port is there too
    EXPECT_EQ(port->state(), PortState::running);
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_EQ(lines[1], settings.path + ": running");
}

}  // namespace
}  // namespace vibrig::test
