// CAN FD: several samples in a frame, and what one frame carries chosen by a multiplexor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/unit/drivers/fd_frames.hpp"

namespace vibrig::test {
namespace {

using namespace drivers;
using ::testing::HasSubstr;

constexpr Time kFdPeriod = 100 * kMicrosecond;

class SeveralSamples : public ::testing::Test {
  protected:
    SeveralSamples() { make(fd_dbc()); }
    void make(const proto::Dbc& dbc) {
        assembler_ = std::make_unique<SampleAssembler>(
            dbc, fd_settings(kFdPeriod), [this](const Sample& s) { samples_.push_back(s); });
    }
    /// A frame comes when the last of its samples has been taken.
    static Time time_of(std::uint32_t first) {
        return 10 * kSecond + static_cast<Time>(first + kFdSamples - 1) * kFdPeriod;
    }
    void feed(std::uint32_t first, int kind) {
        assembler_->feed(fd_frame(first, kind, time_of(first)));
    }
    void feed(std::uint32_t first) {
        feed(first, 0);
        feed(first, 1);
    }
    void expect_closed() const {
        const auto& c = assembler_->counters();
        EXPECT_EQ(c.received, c.used + c.unknown + c.duplicate + c.late + c.wrong_length);
        EXPECT_EQ(c.samples, samples_.size());
    }
    static void expect_truth(const Sample& s) {
        for (std::size_t c = 0; c < kChannels; ++c)
            EXPECT_EQ(s.quality[c], Quality::good) << s.sequence << ", channel " << c;
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_NEAR(s.angle[i], truth(s.sequence, i) * std::numbers::pi / 180, 3.1e-6);
            EXPECT_NEAR(s.force[i], truth(s.sequence, 3 + i), 2e-6);
        }
        EXPECT_NEAR(s.table_accel, truth(s.sequence, 6), 2e-6);
    }

    std::unique_ptr<SampleAssembler> assembler_;
    std::vector<Sample> samples_;
};

TEST_F(SeveralSamples, EachHasItsOwnValuesCountAndTime) {
    // GIVEN 100 pairs of frames, some pairs the other way round
    for (std::uint32_t first = 40; first < 440; first += kFdSamples) {
        const int swapped = first % 3 == 0 ? 1 : 0;
        feed(first, swapped);
        feed(first, 1 - swapped);
    }
    // THEN each of the 400 samples is given out once, in order, a period after the one before
    ASSERT_EQ(samples_.size(), 400U);
    for (std::size_t i = 0; i < samples_.size(); ++i) {
        EXPECT_EQ(samples_[i].sequence, 40 + i);
        expect_truth(samples_[i]);
        EXPECT_NEAR(static_cast<double>(samples_[i].time),
                    static_cast<double>(time_of(40)) +
                        (static_cast<double>(i) - (kFdSamples - 1)) * kFdPeriod,
                    2.0 * kMicrosecond);
    }
    EXPECT_EQ(assembler_->counters().used, 200U);
    EXPECT_EQ(assembler_->counters().gaps, 0U);
    expect_closed();
}

TEST_F(SeveralSamples, ALostFrameLeavesItsChannelsMissingInAllOfThem) {
    feed(0);
    feed(4, 0);  // the forces of 4 to 7 are lost
    for (std::uint32_t first = 8; first < 60; first += kFdSamples) feed(first);
    assembler_->advance(time_of(60) + kSecond);
    ASSERT_EQ(samples_.size(), 60U);
    for (const Sample& s : samples_) {
        const bool lost = s.sequence / kFdSamples == 1;
        EXPECT_EQ(s.quality[static_cast<std::size_t>(Channel::outer)], Quality::good);
        EXPECT_EQ(s.quality[static_cast<std::size_t>(Channel::accel_x)],
                  lost ? Quality::missing : Quality::good)
            << s.sequence;
    }
    EXPECT_EQ(assembler_->counters().incomplete, kFdSamples);
    expect_closed();
}

TEST_F(SeveralSamples, BothFramesLostAreSoManyGaps) {
    feed(0);
    for (std::uint32_t first = 8; first < 60; first += kFdSamples) feed(first);
    assembler_->advance(time_of(60) + kSecond);
    EXPECT_EQ(samples_.size(), 56U);
    EXPECT_EQ(assembler_->counters().gaps, kFdSamples);
    expect_closed();
}

TEST_F(SeveralSamples, AFrameThatComesTwiceCountsOnce) {
    feed(0);
    feed(4, 0);
    feed(4, 0);
    feed(4, 1);
    feed(0, 1);  // its samples are out
    EXPECT_EQ(samples_.size(), 8U);
    EXPECT_EQ(assembler_->counters().duplicate, 1U);
    EXPECT_EQ(assembler_->counters().late, 1U);
    expect_closed();
}

TEST_F(SeveralSamples, ADeviceThatBeginsAnewIsFollowed) {
    for (std::uint32_t first = 100'000; first < 100'040; first += kFdSamples) feed(first);
    ASSERT_EQ(samples_.size(), 40U);
    // WHEN its counter begins at 0, and its frames come in the same rhythm
    const Time anew = time_of(100'040);
    for (std::uint32_t first = 0; first < 40; first += kFdSamples)
        for (const int kind : {0, 1})
            assembler_->feed(fd_frame(first, kind, anew + static_cast<Time>(first) * kFdPeriod));
    assembler_->advance(anew + kSecond);
    // THEN all but what came in the first frame before its last sample are given out
    EXPECT_EQ(assembler_->counters().resyncs, 1U);
    EXPECT_EQ(samples_.size(), 40U + 40U - (kFdSamples - 1));
    EXPECT_EQ(assembler_->counters().gaps, kFdSamples - 1);
    EXPECT_EQ(samples_.back().sequence, 39U);
    expect_truth(samples_.back());
    expect_closed();
}

TEST_F(SeveralSamples, AMessageOfALengthThatNoFrameHasComesInTheNextLongerOne) {
    // GIVEN a message of 53 bytes: CAN FD has frames of 48 and 64
    const auto dbc = proto::parse_dbc(fd_dbc_text(53), "fd.dbc");
    make(dbc);
    for (const int length : {53, 64, 48, 63}) {
        auto frame = fd_frame(0, 0, time_of(0), dbc);
        frame.frame.len = static_cast<std::uint8_t>(length);
        assembler_->feed(frame);
    }
    auto classic = fd_frame(4, 0, time_of(4), dbc);
    classic.fd = false;
    classic.frame.len = 64;
    assembler_->feed(classic);
    EXPECT_EQ(assembler_->counters().wrong_length, 3U);
    EXPECT_EQ(assembler_->counters().duplicate, 1U);
    expect_closed();
}

TEST_F(SeveralSamples, ASignalThatTheDbcLacksIsNamed) {
    auto settings = fd_settings(kFdPeriod);
    settings.samples_per_frame = 5;
    try {
        const SampleAssembler assembler(fd_dbc(), settings, {});
        FAIL() << "nothing thrown";
    } catch (const BindingError& error) {
        EXPECT_THAT(error.what(), HasSubstr("can.signals.outer: found \"Motion.Outer_4\""));
        EXPECT_THAT(error.what(), HasSubstr("can.signals.table_accel: found \"Motion.Axial_4\""));
    }
    settings.samples_per_frame = 17;
    EXPECT_THROW(SampleAssembler(fd_dbc(), settings, {}), BindingError);
}

TEST_F(SeveralSamples, WithoutACounterTheyCannotBeDistinguished) {
    auto settings = fd_settings(kFdPeriod);
    settings.bindings.sync_count = "";
    try {
        const SampleAssembler assembler(fd_dbc(), settings, {});
        FAIL() << "nothing thrown";
    } catch (const BindingError& error) {
        EXPECT_THAT(error.what(), HasSubstr("can.signals.sync_count"));
    }
}

}  // namespace
}  // namespace vibrig::test
