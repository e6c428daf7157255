// What a device says in bits: codes that are neither yes nor no, and how old it is.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::test {
namespace {

using namespace drivers;

class AssemblerFlags : public ::testing::Test {
  protected:
    AssemblerFlags() { make(rig_settings()); }
    void make(const AssemblerSettings& settings) {
        assembler_ = std::make_unique<SampleAssembler>(
            dbc_, settings, [this](const Sample& s) { samples_.push_back(s); });
    }
    /// With signals of another length, of which 2 is an error and 3 not available.
    void change(std::initializer_list<std::pair<std::string_view, std::string_view>> changes,
                const char* end = "") {
        std::string text(proto::rig_dbc_text());
        for (const auto& [from, to] : changes) text.replace(text.find(from), from.size(), to);
        dbc_ = proto::parse_dbc(text + end, "two_bits.dbc");
        make(rig_settings());
    }

    proto::Dbc dbc_ = rig_dbc();
    std::vector<Sample> samples_;
    std::unique_ptr<SampleAssembler> assembler_;
};

TEST_F(AssemblerFlags, AValidityThatIsOutOfItsRangeIsNone) {
    // GIVEN validities of two bits, and one that is a floating-point number
    change({{"OuterValid : 40|1@1+", "OuterValid : 42|2@1+"},
            {"InnerValid : 41|1@1+", "InnerValid : 44|2@1+"},
            {"AzimuthValid : 40|1@1+", "AzimuthValid : 24|32@1-"}},
           "SIG_VALTYPE_ 258 AzimuthValid : 1;\n");
    const auto time_of = [](std::uint32_t count) { return kSecond + count * kPeriod; };
    const auto say = [&](std::uint32_t count, double outer, double inner, float azimuth) {
        std::vector<ReceivedFrame> frames = frames_of_count(count, time_of(count));
        frames[1] = frame_of(dbc_, "Resolvers", time_of(count),
                             {{"Outer", 1},
                              {"Inner", 2},
                              {"OuterValid", outer},
                              {"InnerValid", inner},
                              {"SyncLow", count}});
        frames[2] =
            frame_of(dbc_, "ResolverAzimuth", time_of(count), {{"Azimuth", 3}, {"SyncLow", count}});
        std::memcpy(frames[2].frame.data + 3, &azimuth, sizeof azimuth);
        for (const ReceivedFrame& f : frames) assembler_->feed(f);
    };
    say(1, 1, 1, 1);
    ASSERT_EQ(samples_.size(), 1u);
    EXPECT_TRUE(samples_[0].angles_good());
    say(2, 2, 3, std::numeric_limits<float>::quiet_NaN());
    ASSERT_EQ(samples_.size(), 2u);
    for (const Channel c : {Channel::outer, Channel::inner, Channel::azimuth}) {
        EXPECT_EQ(samples_[1].of(c), Quality::flagged) << name_of(c);
        EXPECT_EQ(assembler_->last_good(c), time_of(1)) << name_of(c);
    }
    EXPECT_EQ(assembler_->counters().invalid, 1u);
}

TEST_F(AssemblerFlags, TheGimbalsAreAsOldAsTheOldestOfTheirSignals) {
    // GIVEN position, slewing and echo in messages of their own
    AssemblerSettings settings = rig_settings();
    settings.bindings.slewing = "PlatformStatus.Ready";
    settings.bindings.command_echo = "GyroIncrements.Counter";
    make(settings);
    const auto say = [this](const char* message, Time time, const char* signal, double value) {
        assembler_->feed(frame_of(dbc_, message, time, {{signal, value}}));
        return assembler_->platform().gimbal_time;
    };
    EXPECT_EQ(say("GimbalStatus", 5 * kSecond, "InPosition", 1), 0);
    EXPECT_EQ(say("GyroIncrements", 6 * kSecond, "Counter", 7), 0) << "slewing is not known";
    EXPECT_EQ(say("PlatformStatus", 7 * kSecond, "Ready", 0), 5 * kSecond);
    // WHEN the others go on alone THEN the position grows no younger by them
    say("GyroIncrements", 8 * kSecond, "Counter", 8);
    EXPECT_EQ(say("PlatformStatus", 9 * kSecond, "Ready", 0), 5 * kSecond);
    EXPECT_EQ(say("GimbalStatus", 10 * kSecond, "InPosition", 1), 8 * kSecond);
    // AND what is not bound is not waited for
    settings.bindings.in_position = settings.bindings.slewing = "";
    make(settings);
    EXPECT_EQ(say("GyroIncrements", 11 * kSecond, "Counter", 9), 11 * kSecond);
}

TEST_F(AssemblerFlags, APositionOutOfItsRangeIsAsOldAsTheLastThatWasNot) {
    change({{"InPosition : 0|1@1+", "InPosition : 24|2@1+"}});
    const auto say = [this](Time time, double in_position) {
        assembler_->feed(frame_of(dbc_, "GimbalStatus", time, {{"InPosition", in_position}}));
        return assembler_->platform().gimbal_time;
    };
    EXPECT_EQ(say(5 * kSecond, 1), 5 * kSecond);
    EXPECT_EQ(say(6 * kSecond, 2), 5 * kSecond);
    EXPECT_EQ(say(7 * kSecond, 3), 5 * kSecond);
    EXPECT_EQ(say(8 * kSecond, 0), 8 * kSecond);
}

TEST_F(AssemblerFlags, APlatformThatDoesNotKnowWhetherItIsReadyIsNot) {
    change({{" Ready : 0|1@1+", " Ready : 32|2@1+"},
            {"GyrosAtSpeed : 2|1@1+", "GyrosAtSpeed : 34|2@1+"}});
    const PlatformStatus& p = assembler_->platform();
    const auto say = [this](Time time, double ready, double at_speed) {
        assembler_->feed(
            frame_of(dbc_, "PlatformStatus", time,
                     {{"LoopClosed", 1}, {"Ready", ready}, {"GyrosAtSpeed", at_speed}}));
    };
    say(5 * kSecond, 1, 1);
    EXPECT_TRUE(p.ready && p.gyros_at_speed);
    // WHEN it says neither yes nor no THEN what it said before holds no longer
    say(6 * kSecond, 2, 3);
    EXPECT_FALSE(p.ready || p.gyros_at_speed);
    EXPECT_TRUE(p.loop_closed);
    EXPECT_EQ(p.time, 6 * kSecond);
    say(7 * kSecond, 1, 1);
    EXPECT_TRUE(p.ready && p.gyros_at_speed);
}

TEST_F(AssemblerFlags, WhatCameEachSecondAndComesNoMoreIsNotReady) {
    // GIVEN ready and speed in messages of their own, loop and fault in one that always comes
    AssemblerSettings settings = rig_settings();
    settings.bindings.ready = "GyroIncrements.Counter";
    settings.bindings.gyros_at_speed = "GimbalStatus.Slewing";
    settings.bindings.slewing = "";
    make(settings);
    const PlatformStatus& p = assembler_->platform();
    Time now = 5 * kSecond;
    const auto say = [&](bool ready, bool at_speed) {
        now += kSecond / 2;
        if (ready) assembler_->feed(frame_of(dbc_, "GyroIncrements", now, {{"Counter", 1}}));
        if (at_speed) assembler_->feed(frame_of(dbc_, "GimbalStatus", now, {{"Slewing", 1}}));
        assembler_->feed(frame_of(dbc_, "PlatformStatus", now, {{"LoopClosed", 1}}));
    };
    for (int n = 0; n < 25; ++n) say(true, true);
    EXPECT_TRUE(p.ready && p.gyros_at_speed);
    // WHEN the one ceases THEN it is believed for three seconds, the other goes on
    for (int n = 0; n < 6; ++n) say(true, false);
    EXPECT_TRUE(p.ready && p.gyros_at_speed);
    say(true, false);
    EXPECT_TRUE(p.ready && !p.gyros_at_speed);
    for (int n = 0; n < 7; ++n) say(false, true);
    EXPECT_TRUE(!p.ready && p.gyros_at_speed);
    EXPECT_TRUE(p.loop_closed);
    EXPECT_EQ(p.time, now);
    // AND when it comes again it is as it says
    say(true, true);
    EXPECT_TRUE(p.ready && p.gyros_at_speed);
}

TEST_F(AssemblerFlags, WhatIsSentOnChangeAloneHolds) {
    AssemblerSettings settings = rig_settings();
    settings.bindings.ready = "GyroIncrements.Counter";
    make(settings);
    const PlatformStatus& p = assembler_->platform();
    // GIVEN that it comes now and then, also several times within a second
    Time now = 5 * kSecond;
    for (int n = 0; n < 60; ++n) {
        now += n % 10 == 0 ? 2 * kSecond : kSecond / 10;
        assembler_->feed(frame_of(dbc_, "GyroIncrements", now, {{"Counter", 1}}));
    }
    for (int n = 0; n < 100; ++n)
        assembler_->feed(frame_of(dbc_, "PlatformStatus", now += kSecond / 2, {{"LoopClosed", 1}}));
    EXPECT_TRUE(p.ready);
}

}  // namespace
}  // namespace vibrig::test
