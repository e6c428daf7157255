#pragma once

#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "drivers/can/can_port.hpp"
#include "drivers/can/receive_batch.hpp"
#include "tests/unit/support/allocation_count.hpp"

/// What any CAN port does, whatever bus it is on: included by the test of each kind, which brings
/// its TestBus.
namespace vibrig::test {

using drivers::CanPort;
using drivers::CanPortCounters;
using drivers::CanPortSettings;
using drivers::PortState;
using drivers::ReceivedFrame;

/// The other end of the bus.
class TestBus {
  public:
    virtual ~TestBus() = default;
    [[nodiscard]] virtual CanPortSettings settings() const = 0;
    /// To be called once the port has started.
    virtual void join() = 0;
    /// One packet of any size onto the bus.
    virtual bool send(std::span<const std::byte> packet) = 0;
    /// The next packet that somebody else sent, waiting up to 10 s. Empty: none.
    [[nodiscard]] virtual std::vector<std::byte> receive() = 0;
    virtual void take_down() = 0;
    virtual void bring_up() = 0;
};

inline canfd_frame make_frame(canid_t id, std::uint64_t value, std::uint8_t length = 8) {
    canfd_frame frame{};
    frame.can_id = id;
    frame.len = length;
    std::memcpy(frame.data, &value, sizeof value);
    return frame;
}

inline std::uint64_t value_of(const canfd_frame& frame) {
    std::uint64_t value = 0;
    std::memcpy(&value, frame.data, sizeof value);
    return value;
}

inline std::span<const std::byte> classic_packet(const canfd_frame& frame) {
    return std::as_bytes(std::span(&frame, 1)).first(CAN_MTU);
}

inline std::span<const std::byte> fd_packet(const canfd_frame& frame) {
    return std::as_bytes(std::span(&frame, 1));
}

using BusFactory = std::function<std::unique_ptr<TestBus>()>;

class CanPortSuite : public ::testing::TestWithParam<BusFactory> {
  protected:
    void SetUp() override {
        bus_ = GetParam()();
        port_ = drivers::make_can_port(io_, bus_->settings());
        frames_.reserve(100'000);
    }

    void start() {
        port_->start(
            [this](std::span<const ReceivedFrame> frames) {
                for (const ReceivedFrame& frame : frames) {
                    if (frames_.size() < frames_.capacity()) frames_.push_back(frame);
                }
            },
            [this](PortState state, const char* text) {
                states_.push_back(state);
                lines_.emplace_back(text);
            },
            [this](const ReceivedFrame& frame) { errors_.push_back(frame); });
        bus_->join();
    }

    /// Runs the io_context until `done`, a minute at most: waiting is long only where the test
    /// fails.
    bool run_until(const std::function<bool()>& done) {
        const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (!done() && std::chrono::steady_clock::now() < give_up) {
            io_.restart();
            io_.run_one_for(std::chrono::milliseconds(100));
        }
        return done();
    }

    void expect_counters_close() const {
        const CanPortCounters c = port_->counters();
        EXPECT_EQ(c.received, c.delivered + c.own + c.error_frames + c.malformed);
    }

    boost::asio::io_context io_;
    std::unique_ptr<TestBus> bus_;
    std::vector<ReceivedFrame> frames_;
    std::vector<ReceivedFrame> errors_;
    std::vector<PortState> states_;
    std::vector<std::string> lines_;
    std::unique_ptr<CanPort> port_;
};

TEST_P(CanPortSuite, DeliversFramesInOrderWithTheirTimeOfArrival) {
    // GIVEN a running port
    start();
    ASSERT_EQ(port_->state(), PortState::running);
    // WHEN 100 frames arrive and wait before they are read
    const drivers::Time before = drivers::ClockPair::now().monotonic;
    for (std::uint64_t i = 0; i < 100; ++i)
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(0x123, i))));
    const drivers::Time after = drivers::ClockPair::now().monotonic;
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    ASSERT_TRUE(run_until([&] { return frames_.size() == 100; }));
    // THEN each is there once, in order, stamped when it was sent and not when it was read, 30 ms
    // later. The two clocks are read one after the other for each batch: a preempted reader makes
    // its stamps early.
    constexpr drivers::Time kAtTheWorst = 10 * drivers::kMillisecond;
    drivers::Time last = 0;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
        const ReceivedFrame& f = frames_[i];
        EXPECT_EQ(f.frame.can_id, 0x123u);
        EXPECT_EQ(value_of(f.frame), i);
        EXPECT_FALSE(f.fd);
        EXPECT_FALSE(f.own);
        EXPECT_EQ(f.frame.flags, 0);
        EXPECT_GE(f.time, before - kAtTheWorst);
        EXPECT_LE(f.time, after + kAtTheWorst);
        EXPECT_GE(f.time, last - kAtTheWorst);
        EXPECT_EQ(f.time % drivers::kMicrosecond, 0);
        last = f.time;
    }
    EXPECT_EQ(port_->counters().delivered, 100u);
    expect_counters_close();
}

TEST_P(CanPortSuite, DeliversFdFrames) {
    start();
    // GIVEN a frame of 64 bytes
    canfd_frame frame = make_frame(0x1ABCDEF | CAN_EFF_FLAG, 7, 64);
    frame.flags = CANFD_BRS;
    frame.data[63] = 0xA5;
    // WHEN it arrives between two classic ones
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 1))));
    ASSERT_TRUE(bus_->send(fd_packet(frame)));
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(2, 2, 2))));
    ASSERT_TRUE(run_until([&] { return frames_.size() == 3; }));
    // THEN it is an FD frame, whole, and leaves nothing in the next one
    EXPECT_TRUE(frames_[1].fd);
    EXPECT_EQ(frames_[1].frame.flags & CANFD_FDF, CANFD_FDF);
    EXPECT_EQ(frames_[1].frame.flags & CANFD_BRS, CANFD_BRS);
    EXPECT_EQ(frames_[1].frame.len, 64);
    EXPECT_EQ(frames_[1].frame.data[63], 0xA5);
    EXPECT_FALSE(frames_[2].fd);
    EXPECT_EQ(frames_[2].frame.len, 2);
    EXPECT_EQ(frames_[2].frame.data[63], 0);
}

TEST_P(CanPortSuite, SendsClassicAndFdFrames) {
    start();
    // WHEN one frame of each kind is sent, and one that no bus can carry
    EXPECT_TRUE(port_->send(make_frame(0x200, 42), false));
    EXPECT_TRUE(port_->send(make_frame(0x201, 43, 12), true));
    EXPECT_FALSE(port_->send(make_frame(0x202, 44, 12), false));
    // THEN the first two are on the bus as they should be
    const std::vector<std::byte> classic = bus_->receive();
    ASSERT_EQ(classic.size(), CAN_MTU);
    const std::vector<std::byte> fd = bus_->receive();
    ASSERT_EQ(fd.size(), CANFD_MTU);
    canfd_frame frame{};
    std::memcpy(&frame, classic.data(), classic.size());
    EXPECT_EQ(frame.can_id, 0x200u);
    EXPECT_EQ(value_of(frame), 42u);
    std::memcpy(&frame, fd.data(), fd.size());
    EXPECT_EQ(frame.can_id, 0x201u);
    EXPECT_EQ(frame.len, 12);
    // AND each attempt is counted
    EXPECT_EQ(port_->counters().sent, 2u);
    EXPECT_EQ(port_->counters().send_failed, 1u);
}

TEST_P(CanPortSuite, HandsErrorFramesToTheErrorHandlerOnly) {
    start();
    // WHEN the controller reports bus-off, then that it has restarted, then data comes
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 0))));
    ASSERT_TRUE(run_until([&] { return errors_.size() == 1; }));
    EXPECT_EQ(port_->counters().controller, drivers::ControllerState::bus_off);
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(CAN_ERR_FLAG | CAN_ERR_RESTARTED, 0))));
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(0x10, 5))));
    ASSERT_TRUE(run_until([&] { return frames_.size() == 1; }));
    // THEN the error frames are counted apart and shown as states
    ASSERT_EQ(errors_.size(), 2u);
    EXPECT_EQ(port_->counters().controller, drivers::ControllerState::active);
    EXPECT_NE(errors_[0].frame.can_id & CAN_ERR_BUSOFF, 0u);
    EXPECT_GT(errors_[0].time, 0);
    EXPECT_EQ(port_->counters().error_frames, 2u);
    EXPECT_EQ(states_, (std::vector{PortState::running, PortState::degraded, PortState::running}));
    expect_counters_close();
}

TEST_P(CanPortSuite, OneFrameThatLooksLikeBusOffDoesNotStay) {
    start();
    // WHEN a frame says bus off, and then the bus goes on as before
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 0))));
    ASSERT_TRUE(run_until([&] { return errors_.size() == 1; }));
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(0x10, 5))));
    ASSERT_TRUE(run_until([&] { return frames_.size() == 1; }));
    // THEN so does the state: who is cut off hears nothing
    EXPECT_EQ(port_->counters().controller, drivers::ControllerState::active);
    EXPECT_EQ(port_->state(), PortState::running);
    // WHEN bus off comes last of what is read at once THEN it stands
    for (const auto id : {canid_t{0x10}, canid_t{CAN_ERR_FLAG | CAN_ERR_BUSOFF}})
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(id, 6))));
    ASSERT_TRUE(run_until([&] { return errors_.size() == 2 && frames_.size() == 2; }));
    EXPECT_EQ(port_->counters().controller, drivers::ControllerState::bus_off);
    EXPECT_EQ(port_->state(), PortState::degraded);
}

TEST_P(CanPortSuite, AllocatesNothingPerBatchOnceStarted) {
    // GIVEN a port that has received before
    start();
    for (std::uint64_t i = 0; i < 10; ++i)
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, i))));
    ASSERT_TRUE(run_until([&] { return frames_.size() == 10; }));
    const std::uint64_t before = allocations();
    // WHEN 50 bursts of 40 frames arrive
    std::size_t wanted = frames_.size();
    for (std::uint64_t burst = 0; burst < 50; ++burst) {
        for (std::uint64_t i = 0; i < 40; ++i) {
            if (!bus_->send(classic_packet(make_frame(2, i)))) break;
        }
        wanted += 40;
        const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (frames_.size() < wanted && std::chrono::steady_clock::now() < give_up) {
            io_.restart();
            io_.run_one_for(std::chrono::milliseconds(100));
        }
    }
    // THEN none of it allocated
    EXPECT_EQ(allocations() - before, 0u);
    EXPECT_EQ(frames_.size(), wanted);
}

TEST_P(CanPortSuite, RecoversAloneWithOneLinePerTransition) {
    start();
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 1))));
    ASSERT_TRUE(run_until([&] { return frames_.size() == 1; }));
    for (int round = 0; round < 2; ++round) {
        const std::size_t lines = lines_.size();
        // WHEN the bus goes away
        bus_->take_down();
        ASSERT_TRUE(run_until([&] { return port_->state() != PortState::running; }));
        EXPECT_FALSE(port_->send(make_frame(1, 1), false));
        // THEN the port waits for it with a few wake-ups, not in a busy loop (100, 200, 400 ms)
        io_.restart();
        EXPECT_LE(io_.run_for(std::chrono::milliseconds(1000)), 8u);
        // AND says each change of state once
        EXPECT_LE(lines_.size() - lines, 2u);
        // WHEN the bus is back
        bus_->bring_up();
        ASSERT_TRUE(run_until([&] { return port_->state() == PortState::running; }))
            << lines_.back();
        bus_->join();
        // THEN frames come and go again
        const std::size_t wanted = frames_.size() + 1;
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 2))));
        EXPECT_TRUE(run_until([&] { return frames_.size() == wanted; }));
        EXPECT_TRUE(port_->send(make_frame(0x77, 3), false));
        EXPECT_EQ(bus_->receive().size(), CAN_MTU);
    }
    for (std::size_t i = 1; i < states_.size(); ++i)
        EXPECT_NE(states_[i], states_[i - 1]) << lines_[i];
    EXPECT_EQ(port_->counters().transitions, states_.size());
    expect_counters_close();
}

TEST_P(CanPortSuite, SendsFromAnotherThreadWhileItReconnects) {
    start();
    // GIVEN a thread that sends all the time
    std::atomic<bool> end{false};
    std::uint64_t attempts = 0;
    std::thread sender([&] {
        while (!end.load()) {
            static_cast<void>(port_->send(make_frame(0x300, attempts), false));
            ++attempts;
            std::this_thread::sleep_for(std::chrono::microseconds(200));
        }
    });
    // WHEN the bus goes away and comes back
    bus_->take_down();
    const bool away = run_until(
        [&] { return port_->state() != PortState::running && port_->counters().send_failed > 0; });
    bus_->bring_up();
    const bool back = run_until([&] { return port_->state() == PortState::running; });
    end.store(true);
    sender.join();
    // THEN every frame was sent or refused, and counted
    EXPECT_TRUE(away);
    EXPECT_TRUE(back);
    const CanPortCounters c = port_->counters();
    EXPECT_EQ(c.sent + c.send_failed, attempts);
}

TEST_P(CanPortSuite, StaysSilentOnceStopped) {
    start();
    ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, 1))));
    // WHEN it is stopped with a frame waiting, and destroyed
    port_->stop();
    EXPECT_EQ(port_->state(), PortState::absent);
    EXPECT_FALSE(port_->send(make_frame(1, 1), false));
    port_.reset();
    // THEN what was pending neither calls nor touches it
    io_.restart();
    io_.run_for(std::chrono::milliseconds(50));
    EXPECT_TRUE(frames_.empty());
}

TEST_P(CanPortSuite, CanBeStoppedByItsOwnHandler) {
    std::size_t calls = 0;
    port_->start([&](std::span<const ReceivedFrame>) { ++calls, port_->stop(); }, nullptr, nullptr);
    bus_->join();
    for (std::uint64_t i = 0; i < 100; ++i)
        ASSERT_TRUE(bus_->send(classic_packet(make_frame(1, i))));
    ASSERT_TRUE(run_until([&] { return calls > 0; }));
    io_.restart();
    io_.run_for(std::chrono::milliseconds(50));
    EXPECT_EQ(calls, 1u);
}

TEST_P(CanPortSuite, CanBeStoppedByItsStateHandler) {
    std::vector<PortState> seen;
    port_->start(
        nullptr,
        [&](PortState state, const char*) {
            seen.push_back(state);
            if (state != PortState::running) port_->stop();
        },
        nullptr);
    bus_->join();
    // WHEN the handler stops the port as the bus goes away
    bus_->take_down();
    ASSERT_TRUE(run_until([&] { return seen.size() == 2; }));
    bus_->bring_up();
    // THEN nothing is left that would connect again
    io_.restart();
    io_.run_for(std::chrono::milliseconds(250));
    EXPECT_EQ(seen.size(), 2u);
    EXPECT_EQ(port_->state(), PortState::absent);
}

}  // namespace vibrig::test
