#include "drivers/sample/assembler.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "tests/unit/drivers/rig_frames.hpp"
#include "tests/unit/support/allocation_count.hpp"

namespace vibrig::test {
namespace {

using namespace drivers;
using ::testing::HasSubstr;

class Assembler : public ::testing::Test {
  protected:
    explicit Assembler(AssemblerSettings settings = rig_settings()) { make(settings); }
    void make(const AssemblerSettings& settings, const proto::Dbc& dbc = rig_dbc()) {
        samples_.reserve(10'000);
        assembler_ = std::make_unique<SampleAssembler>(
            dbc, settings, [this](const Sample& s) { samples_.push_back(s); });
    }
    /// Feeds count `count` at its regular time, without the frames of `lost` (0 Sync, 1 Resolvers,
    /// ...).
    void feed(std::uint32_t count, std::initializer_list<std::size_t> lost = {}) {
        const std::vector<ReceivedFrame> frames = frames_of_count(count, time_of(count));
        for (std::size_t i = 0; i < frames.size(); ++i) {
            if (std::ranges::find(lost, i) == lost.end()) assembler_->feed(frames[i]);
        }
    }
    static Time time_of(std::uint32_t count) {
        return 10 * kSecond + static_cast<Time>(count) * kPeriod;
    }
    void expect_closed() const {
        const AssemblerCounters& c = assembler_->counters();
        EXPECT_EQ(c.received, c.used + c.unknown + c.duplicate + c.late + c.wrong_length);
        EXPECT_EQ(c.samples, samples_.size());
    }
    static void expect_good(const Sample& s, std::uint32_t count) {
        EXPECT_EQ(s.sequence, count);
        for (std::size_t c = 0; c < kChannels; ++c)
            EXPECT_EQ(s.quality[c], Quality::good) << name_of(static_cast<Channel>(c));
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_NEAR(s.angle[i], truth(count, i) * std::numbers::pi / 180, kHalfUnitRad);
            EXPECT_NEAR(s.force[i], truth(count, 3 + i), kHalfUnitG);
        }
        EXPECT_NEAR(s.table_accel, truth(count, 6), kHalfUnitG);
    }

    std::vector<Sample> samples_;
    std::unique_ptr<SampleAssembler> assembler_;
};

TEST_F(Assembler, GivesOutASampleWithItsLastFrame) {
    const std::vector<ReceivedFrame> frames = frames_of_count(7, time_of(7));
    for (std::size_t i = 0; i < frames.size(); ++i) {
        EXPECT_TRUE(samples_.empty());
        assembler_->feed(frames[i]);
    }
    ASSERT_EQ(samples_.size(), 1u);
    expect_good(samples_[0], 7);
    EXPECT_EQ(samples_[0].time, time_of(7));
    EXPECT_EQ(assembler_->next_deadline(), kNever);
    expect_closed();
}

TEST_F(Assembler, KeepsCountAcrossTheWrapsOfSyncLowAndOfTheCounter) {
    // GIVEN counts across 256 and across 2^32
    for (std::uint32_t count = 200; count < 800; ++count) feed(count);
    for (const Sample& s : samples_)
        expect_good(s, 200 + static_cast<std::uint32_t>(&s - samples_.data()));
    ASSERT_EQ(samples_.size(), 600u);
    samples_.clear();
    make(rig_settings());
    std::uint32_t count = std::numeric_limits<std::uint32_t>::max() - 20;
    for (Time t = kSecond; t < 2 * kSecond; t += kPeriod, ++count) {
        for (const ReceivedFrame& f : frames_of_count(count, t)) assembler_->feed(f);
    }
    ASSERT_EQ(samples_.size(), 40u);
    for (std::size_t i = 1; i < samples_.size(); ++i)
        EXPECT_EQ(samples_[i].sequence, samples_[i - 1].sequence + 1);
    EXPECT_EQ(assembler_->counters().resyncs, 0u);
    EXPECT_EQ(assembler_->counters().gaps, 0u);
}

TEST_F(Assembler, GivesOutAnIncompleteSampleAtItsDeadline) {
    feed(1);
    // GIVEN the azimuth frame lost
    feed(2, {2});
    ASSERT_EQ(samples_.size(), 1u);
    EXPECT_EQ(assembler_->next_deadline(), time_of(2) + 20 * kMillisecond);
    assembler_->advance(assembler_->next_deadline() - 1);
    EXPECT_EQ(samples_.size(), 1u);
    // WHEN the deadline comes
    assembler_->advance(assembler_->next_deadline());
    // THEN that channel alone is missing
    ASSERT_EQ(samples_.size(), 2u);
    EXPECT_EQ(samples_[1].of(Channel::azimuth), Quality::missing);
    EXPECT_EQ(samples_[1].of(Channel::outer), Quality::good);
    EXPECT_FALSE(samples_[1].angles_good());
    EXPECT_TRUE(samples_[1].force_good());
    // AND its frame, coming now, is late
    assembler_->feed(frames_of_count(2, time_of(2) + 21 * kMillisecond)[2]);
    EXPECT_EQ(assembler_->counters().late, 1u);
    EXPECT_EQ(assembler_->counters().incomplete, 1u);
    expect_closed();
}

TEST_F(Assembler, CallsASilentChannelStaleAfterItsDeadline) {
    feed(0);
    for (std::uint32_t count = 1; count < 10; ++count) feed(count, {4});
    assembler_->advance(time_of(10));
    ASSERT_EQ(samples_.size(), 10u);
    // THEN it is missing for 100 ms, stale after that, and nothing else is
    for (std::uint32_t count = 1; count < 10; ++count) {
        EXPECT_EQ(samples_[count].of(Channel::accel_z),
                  count <= 4 ? Quality::missing : Quality::stale)
            << count;
        EXPECT_EQ(samples_[count].of(Channel::accel_x), Quality::good);
    }
    EXPECT_EQ(assembler_->last_good(Channel::accel_z), time_of(0));
    EXPECT_FALSE(assembler_->stale(Channel::accel_z, time_of(4)));
    EXPECT_TRUE(assembler_->stale(Channel::accel_z, time_of(4) + 1));
    EXPECT_FALSE(assembler_->stale(Channel::outer, time_of(10)));
    // WHEN it comes back THEN it is good at once
    feed(10);
    expect_good(samples_.back(), 10);
}

TEST_F(Assembler, CallsAChannelThatNeverCameStale) {
    feed(0, {5});
    assembler_->advance(time_of(1));
    EXPECT_EQ(samples_.at(0).of(Channel::table_accel), Quality::stale);
    EXPECT_EQ(assembler_->last_good(Channel::table_accel), 0);
    EXPECT_TRUE(assembler_->stale(Channel::table_accel, time_of(1)));
}

TEST_F(Assembler, MakesASampleWithoutItsSync) {
    for (std::uint32_t count = 300; count < 310; ++count) {
        if (count == 305)
            feed(count, {0});
        else
            feed(count);
    }
    ASSERT_EQ(samples_.size(), 10u);
    for (std::uint32_t i = 0; i < 10; ++i) {
        expect_good(samples_[i], 300 + i);
        EXPECT_EQ(samples_[i].time, time_of(300 + i));
    }
    EXPECT_EQ(assembler_->counters().incomplete, 0u);
}

TEST_F(Assembler, CountsWhatIsNotForASample) {
    feed(1);
    const AssemblerCounters before = assembler_->counters();
    // GIVEN an unknown id, an extended id with a known number, a remote frame, two wrong lengths
    // and a duplicate
    std::vector<ReceivedFrame> frames = frames_of_count(2, time_of(2));
    ReceivedFrame unknown = frames[1];
    unknown.frame.can_id = 0x7FF;
    assembler_->feed(unknown);
    ReceivedFrame extended = frames[1];
    extended.frame.can_id |= CAN_EFF_FLAG;
    assembler_->feed(extended);
    ReceivedFrame remote = frames[1];
    remote.frame.can_id |= CAN_RTR_FLAG;
    assembler_->feed(remote);
    ReceivedFrame brief = frames[1];
    brief.frame.len = 7;
    assembler_->feed(brief);
    brief.frame.len = 0;
    assembler_->feed(brief);
    for (const ReceivedFrame& f : frames) {
        assembler_->feed(f);
        if (&f == &frames[1]) assembler_->feed(f);
    }
    // THEN each is counted as what it is, and the sample is whole
    const AssemblerCounters& c = assembler_->counters();
    EXPECT_EQ(c.unknown - before.unknown, 3u);
    EXPECT_EQ(c.wrong_length - before.wrong_length, 2u);
    EXPECT_EQ(c.duplicate - before.duplicate, 1u);
    EXPECT_EQ(c.used - before.used, 6u);
    expect_good(samples_.at(1), 2);
    expect_closed();
}

TEST_F(Assembler, KeepsTheFirstOfTwoFramesThatDiffer) {
    std::vector<ReceivedFrame> frames = frames_of_count(2, time_of(2));
    assembler_->feed(frames[0]);
    assembler_->feed(frames[1]);
    frames[1].frame.data[0] ^= 0xFF;
    for (std::size_t i = 1; i < frames.size(); ++i) assembler_->feed(frames[i]);
    expect_good(samples_.at(0), 2);
}

TEST_F(Assembler, MarksWhatTheDeviceFlagsAndWhatIsOutOfRange) {
    std::vector<ReceivedFrame> frames = frames_of_count(1, time_of(1));
    // GIVEN the inner resolver flagged invalid, x saturated beyond the DBC's range of 31 g, y
    // inside
    const proto::Dbc dbc = rig_dbc();
    make(rig_settings(), dbc);
    frames[1] = frame_of(
        dbc, "Resolvers", time_of(1),
        {{"Outer", 1}, {"Inner", 2}, {"OuterValid", 1}, {"InnerValid", 0}, {"SyncLow", 1}});
    frames[3] = frame_of(dbc, "AccelerometersXY", time_of(1),
                         {{"X", 31.9}, {"Y", -30.9}, {"XValid", 1}, {"YValid", 1}, {"SyncLow", 1}});
    for (const ReceivedFrame& f : frames) assembler_->feed(f);
    const Sample& s = samples_.at(0);
    EXPECT_EQ(s.of(Channel::outer), Quality::good);
    EXPECT_EQ(s.of(Channel::inner), Quality::flagged);
    EXPECT_EQ(s.of(Channel::accel_x), Quality::out_of_range);
    EXPECT_EQ(s.of(Channel::accel_y), Quality::good);
    // THEN a flagged value is no sign of life
    EXPECT_EQ(assembler_->last_good(Channel::inner), 0);
    EXPECT_EQ(assembler_->counters().incomplete, 0u);
    EXPECT_EQ(assembler_->counters().invalid, 1u);
}

TEST_F(Assembler, WrapsAnglesIntoOneTurn) {
    // GIVEN a resolver box that counts from -180 to 180 deg, with an offset
    proto::Dbc dbc = rig_dbc();
    for (proto::Message& m : dbc.messages) {
        for (proto::Signal& s : m.signals) {
            if (s.name == "Outer" && m.name == "Resolvers")
                s.offset = -360, s.minimum = -360, s.maximum = 720;
        }
    }
    make(rig_settings(), dbc);
    std::vector<ReceivedFrame> frames = frames_of_count(1, time_of(1));
    frames[1] = frame_of(
        dbc, "Resolvers", time_of(1),
        {{"Outer", -90}, {"Inner", 0}, {"OuterValid", 1}, {"InnerValid", 1}, {"SyncLow", 1}});
    for (const ReceivedFrame& f : frames) assembler_->feed(f);
    EXPECT_NEAR(samples_.at(0).angle[0], 1.5 * std::numbers::pi, kHalfUnitRad);
    EXPECT_EQ(samples_.at(0).angle[1], 0.0);
}

TEST_F(Assembler, FollowsARestartOfTheDevice) {
    for (std::uint32_t count = 5000; count < 5020; ++count) feed(count);
    // WHEN the device restarts at 0 and its time goes on
    for (std::uint32_t count = 0; count < 20; ++count) {
        for (const ReceivedFrame& f : frames_of_count(count, time_of(5020 + count)))
            assembler_->feed(f);
    }
    // THEN no sample is lost, mixed or out of time, and it is counted once
    ASSERT_EQ(samples_.size(), 40u);
    for (std::uint32_t i = 0; i < 20; ++i) {
        expect_good(samples_[20 + i], i);
        EXPECT_EQ(samples_[20 + i].time, time_of(5020 + i));
    }
    EXPECT_EQ(assembler_->counters().resyncs, 1u);
    EXPECT_EQ(assembler_->counters().gaps, 0u);
    expect_closed();
}

TEST_F(Assembler, CountsADeviceWhoseTimeStoodStill) {
    for (std::uint32_t count = 0; count < 20; ++count) feed(count);
    // WHEN the count goes on where it was, 40 periods later
    for (std::uint32_t count = 20; count < 40; ++count) {
        for (const ReceivedFrame& f : frames_of_count(count, time_of(count + 40)))
            assembler_->feed(f);
    }
    // THEN no sample is lost, the newest have the new time, and it is counted once
    ASSERT_EQ(samples_.size(), 40u);
    EXPECT_EQ(samples_.back().time, time_of(39 + 40));
    EXPECT_EQ(assembler_->counters().resyncs, 1u);
    EXPECT_EQ(assembler_->counters().gaps, 0u);
    expect_closed();
}

TEST_F(Assembler, IsNotMisledByOneWrongCount) {
    for (std::uint32_t count = 100; count < 120; ++count) {
        feed(count);
        // GIVEN a stray Sync with an absurd count, twice, and a stray channel frame of another age
        if (count % 7 == 0)
            assembler_->feed(
                frame_of(rig_dbc(), "Sync", time_of(count) + 1000, {{"SyncCount", 4e9}}));
        if (count == 110) assembler_->feed(frames_of_count(count + 90, time_of(count) + 2000)[1]);
    }
    // THEN the samples go on as if it had not been
    ASSERT_EQ(samples_.size(), 20u);
    for (std::uint32_t i = 0; i < 20; ++i) expect_good(samples_[i], 100 + i);
    EXPECT_EQ(assembler_->counters().resyncs, 0u);
    EXPECT_EQ(assembler_->counters().late, 1u);
    EXPECT_GT(assembler_->counters().unknown, 0u);
    expect_closed();
}

TEST_F(Assembler, CountsTheGapOfASilence) {
    for (std::uint32_t count = 0; count < 10; ++count) feed(count);
    // WHEN nothing comes for 50 s of 2000 counts, and the first Sync after it is lost
    feed(2010, {0});
    for (std::uint32_t count = 2011; count < 2020; ++count) feed(count);
    ASSERT_EQ(samples_.size(), 20u);
    for (std::uint32_t i = 0; i < 10; ++i) expect_good(samples_[10 + i], 2010 + i);
    EXPECT_EQ(assembler_->counters().gaps, 2000u);
    EXPECT_EQ(assembler_->counters().resyncs, 0u);
    expect_closed();
}

TEST_F(Assembler, KnowsEachTemperatureAndWhenItCame) {
    // GIVEN a platform that tells one temperature after the other
    constexpr std::array<const char*, 4> kNames{"Case", "GyroX", "GyroY", "GyroZ"};
    const auto temperature = [&](std::size_t sensor, Time time, double value) {
        assembler_->feed(
            frame_of(rig_dbc(), "PlatformTemperatures", time,
                     {{"Sensor", static_cast<double>(sensor)}, {kNames[sensor], value}}));
    };
    // WHEN three of four have come, one of them twice
    temperature(0, 5 * kSecond, 20.5);
    temperature(2, 6 * kSecond, -3.25);
    temperature(3, 7 * kSecond, 61);
    temperature(2, 8 * kSecond, -3.5);
    // THEN each is known with its time, and the platform's own status has not come
    const PlatformStatus& p = assembler_->platform();
    EXPECT_NEAR(p.sensor_c[0], 20.5, 1e-9);
    EXPECT_NEAR(p.sensor_c[2], -3.5, 1e-9);
    EXPECT_NEAR(p.sensor_c[3], 61, 1e-9);
    EXPECT_EQ(p.sensor_time, (std::array<Time, 4>{5 * kSecond, 0, 8 * kSecond, 7 * kSecond}));
    EXPECT_EQ(p.time, 0);
    EXPECT_EQ(assembler_->counters().unknown, 0u);
    expect_closed();
}

TEST_F(Assembler, FollowsThePlatformAndItsGimbals) {
    EXPECT_EQ(assembler_->platform().time, 0);
    assembler_->feed(frame_of(rig_dbc(), "PlatformStatus", 5 * kSecond,
                              {{"Ready", 1},
                               {"LoopClosed", 1},
                               {"GyrosAtSpeed", 0},
                               {"Fault", 1},
                               {"Temperature", -12.34}}));
    assembler_->feed(frame_of(rig_dbc(), "GimbalStatus", 6 * kSecond,
                              {{"InPosition", 1}, {"Slewing", 1}, {"CommandEcho", 200}}));
    const PlatformStatus& p = assembler_->platform();
    EXPECT_EQ(p.time, 5 * kSecond);
    EXPECT_TRUE(p.ready && p.loop_closed && !p.gyros_at_speed && p.fault);
    EXPECT_NEAR(p.temperature_c, -12.34, 1e-9);
    EXPECT_EQ(p.gimbal_time, 6 * kSecond);
    EXPECT_TRUE(p.in_position && p.slewing);
    EXPECT_EQ(p.gimbal_command_echo, 200);
    EXPECT_EQ(assembler_->counters().used, 2u);
    expect_closed();
}

TEST_F(Assembler, TakesThePlatformForAsOldAsTheOlderOfLoopAndFault) {
    // GIVEN loop, fault and temperature in messages of their own
    AssemblerSettings settings = rig_settings();
    settings.bindings.fault = "GimbalStatus.Torquing";
    settings.bindings.temperature = "PlatformTemperatures.Case";
    make(settings);
    const auto say = [this](const char* message, Time time,
                            const std::vector<std::pair<std::string_view, double>>& values) {
        assembler_->feed(frame_of(rig_dbc(), message, time, values));
    };
    say("PlatformStatus", 5 * kSecond, {{"LoopClosed", 1}, {"Ready", 1}});
    EXPECT_EQ(assembler_->platform().time, 0) << "of the fault nothing is known";
    say("GimbalStatus", 6 * kSecond, {{"Torquing", 0}});
    EXPECT_EQ(assembler_->platform().time, 5 * kSecond);
    // WHEN the temperature alone comes on THEN it is fresh, and the platform is not
    say("PlatformTemperatures", 7 * kSecond, {{"Sensor", 0}, {"Case", 30}});
    say("GimbalStatus", 8 * kSecond, {{"Torquing", 0}});
    EXPECT_EQ(assembler_->platform().time, 5 * kSecond);
    EXPECT_EQ(assembler_->platform().temperature_time, 7 * kSecond);
    say("PlatformStatus", 9 * kSecond, {{"LoopClosed", 1}});
    EXPECT_EQ(assembler_->platform().time, 8 * kSecond);
}

TEST_F(Assembler, KeepsAFaultThatIsDeniedRightAfterUntilASampleIsJudged) {
    PlatformStatus judged;
    assembler_ = std::make_unique<SampleAssembler>(
        rig_dbc(), rig_settings(), [&](const Sample&) { judged = assembler_->platform(); });
    const auto say = [this](bool well) {
        assembler_->feed(frame_of(rig_dbc(), "PlatformStatus", time_of(2),
                                  {{"LoopClosed", well ? 1 : 0}, {"Fault", well ? 0 : 1}}));
    };
    feed(1);
    EXPECT_FALSE(judged.loop_was_open || judged.had_fault) << "nothing was said yet";
    say(false);
    say(true);
    feed(2);
    EXPECT_TRUE(judged.loop_was_open && judged.had_fault);
    EXPECT_TRUE(judged.loop_closed && !judged.fault);
    feed(3);
    EXPECT_FALSE(judged.loop_was_open || judged.had_fault);
}

TEST_F(Assembler, WithoutItsCountNoChannelIsFresh) {
    for (std::uint32_t count = 1; count < 40; ++count) feed(count);
    const auto silent_since = time_of(39);
    for (std::uint32_t count = 40; count < 80; ++count) {
        feed(count, {0});
        const bool silent = time_of(count) - silent_since > rig_settings().stale_deadline;
        EXPECT_EQ(assembler_->sync_silent(time_of(count)), silent) << count;
        EXPECT_EQ(assembler_->stale(Channel::outer, time_of(count)), silent) << count;
        if (silent) {
            EXPECT_EQ(assembler_->last_good(Channel::outer), silent_since) << count;
        }
    }
    feed(80);
    EXPECT_FALSE(assembler_->stale(Channel::outer, time_of(80)));
    EXPECT_EQ(assembler_->last_good(Channel::outer), time_of(80));
}

TEST_F(Assembler, ACountThatComesSeldomHasASecond) {
    for (std::uint32_t count = 1; count < 200; ++count) {
        feed(count, count % 20 == 1 ? std::initializer_list<std::size_t>{}
                                    : std::initializer_list<std::size_t>{0});
        if (count > 60) {
            ASSERT_FALSE(assembler_->sync_silent(time_of(count))) << count;
        }
    }
    EXPECT_TRUE(assembler_->sync_silent(time_of(181) + 2 * kSecond));
}

TEST_F(Assembler, NamesTheIdOfTwoNodesThatContradictEachOther) {
    feed(1);
    std::vector<ReceivedFrame> frames = frames_of_count(2, time_of(2));
    // The same frame twice says nothing new.
    for (const std::size_t i : {0U, 1U, 1U}) assembler_->feed(frames[i]);
    EXPECT_EQ(assembler_->counters().contradicting, 0u);
    ReceivedFrame other = frames[1];
    other.frame.data[3] ^= 0x10;
    assembler_->feed(other);
    EXPECT_EQ(assembler_->counters().contradicting, 1u);
    EXPECT_EQ(assembler_->counters().contradicting_id, 257u);
    EXPECT_EQ(assembler_->counters().duplicate, 2u);
    for (std::size_t i = 2; i < frames.size(); ++i) assembler_->feed(frames[i]);
    expect_good(samples_.back(), 2);
    expect_closed();
}

TEST_F(Assembler, WorksWithoutASyncCounter) {
    // GIVEN a lab whose devices have none
    AssemblerSettings settings = rig_settings();
    settings.bindings.sync_count = "";
    make(settings);
    for (std::uint32_t count = 50; count < 60; ++count) {
        if (count == 55)
            feed(count, {0, 3});
        else
            feed(count, {0});
    }
    assembler_->advance(time_of(60));
    // THEN frames within half a period form a sample at the kernel's stamp
    ASSERT_EQ(samples_.size(), 10u);
    for (std::uint32_t i = 0; i < 10; ++i) {
        EXPECT_EQ(samples_[i].sequence, i);
        EXPECT_EQ(samples_[i].time, time_of(50 + i));
        EXPECT_NEAR(samples_[i].force[2], truth(50 + i, 5), kHalfUnitG);
        EXPECT_EQ(samples_[i].of(Channel::accel_x), i == 5 ? Quality::missing : Quality::good);
    }
    expect_closed();
}

TEST_F(Assembler, PutsFramesWithoutSyncLowWithTheNewestCount) {
    AssemblerSettings settings = rig_settings();
    settings.bindings.message_sync_signal = "";
    make(settings);
    for (std::uint32_t count = 50; count < 60; ++count) feed(count);
    ASSERT_EQ(samples_.size(), 10u);
    for (std::uint32_t i = 0; i < 10; ++i) expect_good(samples_[i], 50 + i);
}

TEST_F(Assembler, LeavesUnboundChannelsUnbound) {
    AssemblerSettings settings = rig_settings();
    settings.bindings.table_accel = "";
    settings.bindings.outer_valid = "";
    make(settings);
    feed(1, {5});
    ASSERT_EQ(samples_.size(), 1u);
    EXPECT_EQ(samples_[0].of(Channel::table_accel), Quality::unbound);
    EXPECT_EQ(samples_[0].of(Channel::outer), Quality::good);
    EXPECT_EQ(assembler_->counters().incomplete, 0u);
}

TEST_F(Assembler, AllocatesNothingOnceBuilt) {
    std::vector<ReceivedFrame> frames;
    for (std::uint32_t count = 0; count < 100; ++count) {
        for (const ReceivedFrame& f : frames_of_count(count, time_of(count))) frames.push_back(f);
    }
    const std::uint64_t before = allocations();
    for (const ReceivedFrame& f : frames) {
        assembler_->feed(f);
        assembler_->advance(f.time);
    }
    EXPECT_EQ(allocations() - before, 0u);
    EXPECT_EQ(samples_.size(), 100u);
}

TEST(AssemblerBindings, NameTheKeyTheValueAndWhatThereIs) {
    const auto message_of = [](const std::function<void(SignalBindings&)>& spoil) {
        AssemblerSettings settings = rig_settings();
        spoil(settings.bindings);
        try {
            const SampleAssembler assembler(rig_dbc(), settings, {});
        } catch (const BindingError& error) {
            return std::string(error.what());
        }
        return std::string("no error");
    };
    EXPECT_THAT(message_of([](auto& b) { b.outer = "Resolvers.Outr"; }),
                AllOf(HasSubstr("can.signals.outer: found \"Resolvers.Outr\""),
                      HasSubstr("Resolvers.Outer")));
    EXPECT_THAT(message_of([](auto& b) { b.accel_z = "AcelerometerZ.Z"; }),
                AllOf(HasSubstr("can.signals.accel_z"), HasSubstr("AccelerometerZ.Z")));
    EXPECT_THAT(message_of([](auto& b) { b.sync_count = "SyncCount"; }),
                AllOf(HasSubstr("can.signals.sync_count"), HasSubstr("Message.Signal"),
                      HasSubstr("Sync.SyncCount")));
    EXPECT_THAT(message_of([](auto& b) {
                    b.outer = b.inner = b.azimuth = b.accel_x = b.accel_y = b.accel_z =
                        b.table_accel = "";
                }),
                HasSubstr("at least one measured channel"));
    EXPECT_EQ(message_of([](auto&) {}), "no error");
}

TEST(AssemblerBindings, DoNotAskForTemperaturesThatNobodyNamed) {
    // GIVEN a DBC without the message of the temperatures
    proto::Dbc dbc = rig_dbc();
    std::erase_if(dbc.messages, [](const auto& m) { return m.name == "PlatformTemperatures"; });
    AssemblerSettings settings = rig_settings();
    // THEN it is bound without them, unless one is named
    EXPECT_NO_THROW(SampleAssembler(dbc, settings, {}));
    settings.bindings.temperature_case = "Temperatures.Case";
    EXPECT_THROW(SampleAssembler(dbc, settings, {}), BindingError);
}

TEST(AssemblerBindings, NameAllThatIsMissingAtOnce) {
    AssemblerSettings settings = rig_settings();
    settings.bindings.outer = "Angles.Alpha";
    settings.bindings.fault = "State.Broken";
    settings.bindings.accel_z_valid = "AccelerometerZ.Good";
    try {
        const SampleAssembler assembler(rig_dbc(), settings, {});
        ADD_FAILURE() << "no error";
    } catch (const BindingError& error) {
        ASSERT_EQ(error.all().size(), 3u) << error.what();
        EXPECT_EQ(error.all()[0].key(), "can.signals.outer");
        EXPECT_EQ(error.all()[1].key(), "can.signals.accel_z_valid");
        EXPECT_EQ(error.all()[2].key(), "can.signals.fault");
        const std::string text = error.what();
        EXPECT_EQ(std::ranges::count(text, '\n'), 2) << text;
    }
}

TEST(AssemblerBindings, ASignalInAnotherUnitIsRefused) {
    const auto refusal = [](const char* message, const char* signal, const char* unit) {
        proto::Dbc dbc = rig_dbc();
        auto at = std::ranges::find(dbc.messages, message, &proto::Message::name);
        std::ranges::find(at->signals, signal, &proto::Signal::name)->unit = unit;
        try {
            const SampleAssembler assembler(dbc, rig_settings(), {});
        } catch (const BindingError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_THAT(refusal("Resolvers", "Outer", "rad"),
                HasSubstr("can.signals.outer: found \"Resolvers.Outer\", expected a signal in deg; "
                          "in the DBC it is in rad"));
    EXPECT_THAT(refusal("AccelerometersXY", "Y", "m/s^2"), HasSubstr("can.signals.accel_y"));
    EXPECT_THAT(refusal("TableAccelerometer", "Axial", "mg"), HasSubstr("can.signals.table_accel"));
    EXPECT_THAT(refusal("PlatformStatus", "Temperature", "K"),
                HasSubstr("expected a signal in degC"));
    // It says nothing, or the same in other letters.
    for (const char* unit : {"", "deg", "degrees", "\xb0", "\xc2\xb0"})
        EXPECT_EQ(refusal("Resolvers", "Outer", unit), "");
}

TEST(AssemblerBindings, RefuseSettingsThatCannotWork) {
    for (const auto& spoil : std::vector<std::function<void(AssemblerSettings&)>>{
             [](auto& s) { s.open_samples = 0; }, [](auto& s) { s.open_samples = 65; },
             [](auto& s) { s.sample_period = 0; }, [](auto& s) { s.join_deadline = -1; },
             [](auto& s) { s.stale_deadline = 0; }}) {
        AssemblerSettings settings = rig_settings();
        spoil(settings);
        EXPECT_THROW(SampleAssembler(rig_dbc(), settings, {}), BindingError);
    }
    EXPECT_NO_THROW(SampleAssembler(rig_dbc(), rig_settings(), {}));
}

TEST(AssemblerSettings, HaveNoRateThatNobodyStated) {
    try {
        const SampleAssembler assembler(rig_dbc(), {}, {});
        ADD_FAILURE() << "no error";
    } catch (const BindingError& error) {
        EXPECT_EQ(error.key(), "can.sample_period");
    }
}

}  // namespace
}  // namespace vibrig::test
