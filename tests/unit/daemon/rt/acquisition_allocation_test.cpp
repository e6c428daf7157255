#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <boost/asio/post.hpp>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <thread>

#include "daemon/rt/acquisition.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/real_clock.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"
#include "tests/unit/support/allocation_count.hpp"

namespace vibrig::rt {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;

/// Encodes one message of rig.dbc from named values.
canfd_frame frame_of(const proto::Dbc& dbc, const char* message,
                     const std::vector<std::pair<const char*, double>>& values) {
    const auto* m = dbc.find(message);
    canfd_frame frame{};
    frame.can_id = m->id;
    frame.len = m->size;
    for (const auto& [name, value] : values)
        EXPECT_TRUE(proto::encode(*m->find(name), value, {frame.data, frame.len})) << name;
    return frame;
}

TEST(RealTimeThreads, AllocateNothingAfterStartUp) {
    // GIVEN a bus, the acquisition and the estimator on their own threads, and a dwell ordered
    const std::string path = "@vibrig-allocation-test-" + std::to_string(::getpid());
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, path.data() + 1, path.size() - 1);
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
    const int listener = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
    ASSERT_EQ(::bind(listener, reinterpret_cast<sockaddr*>(&address), length), 0);
    ASSERT_EQ(::listen(listener, 1), 0);

    const auto dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    RealClock clock;
    const auto control = clock.make_waiter();
    const auto estimator_waiter = clock.make_waiter();
    FakeShaker shaker;
    Interlock interlock(shaker, *control,
                        {.table_g = 12.0, .witness = {.sample_period = 2 * kMillisecond}});
    interlock.guard(Guard::excitation);
    Ring<drivers::Sample> ring(4096);
    estimator::Identification identification{estimator::Settings{}};
    EstimatorStage stage(ring, *estimator_waiter, *control, identification);
    boost::asio::io_context io(1);
    drivers::CanPortSettings can;
    can.kind = drivers::CanPortSettings::Kind::seqpacket;
    can.path = path;
    const auto port = drivers::make_can_port(io, can);
    drivers::AssemblerSettings settings;
    settings.sample_period = 2 * kMillisecond;  // faster than life, to be done soon
    StageFeedSettings with_increments;
    with_increments.increments = true;
    with_increments.block = 4;
    StageFeed stages(dbc, with_increments, control.get());
    Ring<FrameRecord> recorder_frames(1024);  // nobody takes: what does not fit is dropped
    Ring<drivers::Sample> recorder_samples(1024);
    Ring<drivers::Sample> pre_trip(1024);
    RestMonitor rest({}, settings.sample_period);
    Acquisition acquisition(io, *port, dbc, settings, clock, nullptr,
                            {ring, *estimator_waiter, *control, interlock, &stages,
                             &recorder_frames, &recorder_samples, &pre_trip, nullptr, &rest});
    acquisition.start([](drivers::PortState, const char*) {});
    DwellOrder order;
    // Long enough for the test, short enough for blocks of a second.
    order.from = clock.now();
    order.to = order.from + 100 * kSecond;
    ASSERT_TRUE(stage.order(order));
    std::thread acquisition_thread([&] {
        test::watch_this_thread();
        io.run();
    });
    std::thread estimator_thread([&] {
        test::watch_this_thread();
        stage.run();
    });
    const int bus = ::accept(listener, nullptr, nullptr);
    ASSERT_GE(bus, 0);

    // WHEN samples stream, complete and with losses, garbage and platform status between them
    constexpr std::uint32_t kSamples = 4000;
    const auto filtered = [&](std::uint64_t samples) {  // true as soon as there are as many
        const auto deadline = clock.now() + 60 * kSecond;
        while (stage.ring().popped < samples && clock.now() < deadline)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return stage.ring().popped >= samples;
    };
    std::uint64_t before = 0;
    for (std::uint32_t n = 0; n < kSamples; ++n) {
        if (n == kSamples / 4) {
            ASSERT_TRUE(filtered(kSamples / 8)) << "start-up is over";
            before = test::watched_allocations();
        }
        // Each stage of the campaign in turn; their pieces wait for nobody.
        if (n == kSamples / 2) stages.order(StageFeed::Mode::force);
        if (n == kSamples * 3 / 4) stages.order(StageFeed::Mode::increments);
        const double low = n % 256;
        const double f = std::sin(0.37 * n);
        std::vector<canfd_frame> frames{
            frame_of(dbc, "Sync", {{"SyncCount", n}}),
            frame_of(dbc, "Resolvers",
                     {{"Outer", 0.01},
                      {"Inner", 0.02},
                      {"OuterValid", 1},
                      {"InnerValid", 1},
                      {"SyncLow", low}}),
            frame_of(dbc, "ResolverAzimuth",
                     {{"Azimuth", 359.9}, {"AzimuthValid", 1}, {"SyncLow", low}}),
            frame_of(dbc, "AccelerometersXY",
                     {{"X", 0}, {"Y", 1 + f}, {"XValid", 1}, {"YValid", 1}, {"SyncLow", low}}),
            frame_of(dbc, "AccelerometerZ", {{"Z", 0}, {"ZValid", 1}, {"SyncLow", low}}),
            frame_of(dbc, "TableAccelerometer", {{"Axial", f}, {"SyncLow", low}})};
        if (n % 4 == 0)
            frames.push_back(frame_of(dbc, "PlatformStatus",
                                      {{"LoopClosed", 1}, {"Ready", 1}, {"Temperature", 20}}));
        if (n > kSamples * 3 / 4) {
            const double counter = n % 256;
            frames.push_back(frame_of(dbc, "GyroIncrements", {{"X", 1}, {"Counter", counter}}));
            frames.push_back(
                frame_of(dbc, "AccelerometerIncrements", {{"Z", 0.1}, {"Counter", counter}}));
        }
        if (n % 10 == 0) frames.push_back(frame_of(dbc, "GimbalStatus", {{"Torquing", 1}}));
        if (n % 50 == 7) frames.erase(frames.begin() + n % 6);
        if (n % 70 == 3) frames[1].can_id = 0x7ff;
        for (const auto& frame : frames)
            ASSERT_EQ(::send(bus, &frame, CAN_MTU, 0), static_cast<ssize_t>(CAN_MTU));
        // One by one: of samples in bursts the clock would learn the rate of the burst.
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    EXPECT_TRUE(filtered(kSamples - 16));
    const std::uint64_t after = test::watched_allocations();
    // Before the dwell ends: a busy machine sends no sine of equal steps, and the dwell may be
    // rejected as a whole then.
    const std::uint64_t used = stage.view().estimate.used;
    acquisition.stop();
    acquisition_thread.join();
    stage.stop();
    estimator_thread.join();
    ::close(bus);
    ::close(listener);
    // THEN the samples went through the filter and neither thread allocated
    EXPECT_GT(stage.view().in_dwell, kSamples * 9 / 10);
    EXPECT_GT(used, kSamples / 2);
    EXPECT_EQ(after - before, 0U);
    // and so did the frames and samples for the recorder and the pieces for the stages
    EXPECT_GT(recorder_frames.counts().pushed + recorder_frames.counts().dropped, 6 * kSamples);
    EXPECT_GT(recorder_samples.counts().dropped, 0U);
    EXPECT_GT(pre_trip.counts().dropped, 0U);
    EXPECT_GT(stages.counters().pairs, kSamples / 5);
    EXPECT_TRUE(stages.torque().torquing);
    Motion motion;
    ASSERT_TRUE(stages.pop(motion));
    EXPECT_TRUE(motion.increment);
    // and means of their angles, of one second each, have come to the control thread's side
    BlockRecord block;
    ASSERT_TRUE(stage.take_block(block));
    EXPECT_EQ(block.block_s, 1.0);
    EXPECT_GT(block.samples, 0U);
    EXPECT_NEAR(block.angle_rad[1], 0.02 * 3.14159265358979 / 180, 6e-6);
}

}  // namespace
}  // namespace vibrig::rt
