#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "drivers/sample/assembler.hpp"
#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::test {
namespace {

using namespace drivers;

constexpr std::uint32_t kCounts = 2000;
constexpr Time kStart = 10 * kSecond;
/// Frame of the rig's order that carries each channel.
constexpr std::array<std::size_t, kChannels> kFrameOf{1, 1, 2, 3, 3, 4, 5};

struct Trouble {
    const char* name;
    double loss;
    double duplicate;
    double garbage;  ///< foreign, cut and remote frames, per good frame
    Time jitter;     ///< uniform delay of each frame
};

struct Traffic {
    std::vector<ReceivedFrame> frames;  // in the order of arrival
    std::set<std::pair<std::uint32_t, std::size_t>>
        sent;  // (count, frame of it) that came at least once
    std::uint64_t unknown = 0;
    std::uint64_t wrong_length = 0;
};

Traffic make_traffic(const Trouble& trouble, std::uint32_t first, std::mt19937& random) {
    std::uniform_real_distribution<double> chance(0, 1);
    std::uniform_int_distribution<Time> delay(0, trouble.jitter / kMicrosecond);
    Traffic traffic;
    for (std::uint32_t i = 0; i < kCounts; ++i) {
        const std::uint32_t count = first + i;
        const Time time = kStart + i * kPeriod;
        const std::vector<ReceivedFrame> frames = frames_of_count(count, time);
        for (std::size_t k = 0; k < frames.size(); ++k) {
            if (i > 0 && chance(random) < trouble.loss) continue;  // the first one sets the count
            traffic.sent.emplace(count, k);
            for (int copy = chance(random) < trouble.duplicate ? 2 : 1; copy > 0; --copy) {
                traffic.frames.push_back(frames[k]);
                // The first one sets the count: its Sync is not to be overtaken.
                if (i > 0) traffic.frames.back().time += delay(random) * kMicrosecond;
            }
            if (chance(random) >= trouble.garbage) continue;
            ReceivedFrame bad = frames[k];
            bad.time += delay(random) * kMicrosecond;
            switch (random() % 3) {
                case 0:
                    bad.frame.can_id = 0x600 + random() % 0x100, ++traffic.unknown;
                    break;
                case 1:
                    bad.frame.can_id |= CAN_RTR_FLAG, ++traffic.unknown;
                    break;
                default:
                    bad.frame.len = static_cast<std::uint8_t>(random() % 8), ++traffic.wrong_length;
                    break;
            }
            traffic.frames.push_back(bad);
        }
    }
    std::ranges::stable_sort(traffic.frames, {}, &ReceivedFrame::time);
    return traffic;
}

class AssemblerUnderTrouble : public ::testing::TestWithParam<Trouble> {};

TEST_P(AssemblerUnderTrouble, KeepsOrderValuesTimesAndCounts) {
    const Trouble& trouble = GetParam();
    for (unsigned seed = 1; seed <= 4; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        std::mt19937 random(seed);
        const std::uint32_t first =
            static_cast<std::uint32_t>(random());  // anywhere in the counter's range
        const Traffic traffic = make_traffic(trouble, first, random);

        // WHEN the frames come as they come, with deadlines served now and then
        std::vector<Sample> samples;
        SampleAssembler assembler(rig_dbc(), rig_settings(),
                                  [&](const Sample& s) { samples.push_back(s); });
        for (const ReceivedFrame& frame : traffic.frames) {
            if (random() % 4 == 0)
                assembler.advance(std::min(frame.time, assembler.next_deadline()));
            assembler.feed(frame);
        }
        assembler.advance(kNever);

        // THEN every frame is accounted for
        const AssemblerCounters& c = assembler.counters();
        EXPECT_EQ(c.received, traffic.frames.size());
        EXPECT_EQ(c.received, c.used + c.unknown + c.duplicate + c.late + c.wrong_length);
        EXPECT_EQ(c.unknown, traffic.unknown);
        EXPECT_EQ(c.wrong_length, traffic.wrong_length);
        EXPECT_EQ(c.resyncs, 0u);
        EXPECT_EQ(c.samples, samples.size());
        // AND every count between the first and the last is either a sample or a gap
        ASSERT_FALSE(samples.empty());
        EXPECT_EQ(c.samples + c.gaps, samples.back().sequence - samples.front().sequence + 1);

        std::uint64_t good_of_sent = 0;
        std::uint64_t incomplete = 0;
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const Sample& s = samples[i];
            const std::uint32_t index = s.sequence - first;
            if (i > 0) {
                ASSERT_GT(index, samples[i - 1].sequence - first);
                ASSERT_GT(s.time, samples[i - 1].time);
            }
            EXPECT_EQ(s.time % kMicrosecond, 0);
            // The fit carries the mean delay; no single stamp's delay exceeds the jitter.
            const Time device = kStart + index * kPeriod;
            EXPECT_GE(s.time, device - trouble.jitter) << index;
            EXPECT_LE(s.time, device + trouble.jitter) << index;
            bool missing = false;
            for (std::size_t channel = 0; channel < kChannels; ++channel) {
                const bool came = traffic.sent.contains({s.sequence, kFrameOf[channel]});
                if (s.quality[channel] != Quality::good) {
                    missing = true;
                    continue;
                }
                // THEN no value is invented, and none belongs to another count
                EXPECT_TRUE(came) << index << " " << channel;
                ++good_of_sent;
                const double value = truth(s.sequence, channel);
                if (channel < 3) {
                    EXPECT_NEAR(s.angle[channel], value * std::numbers::pi / 180, kHalfUnitRad);
                } else {
                    EXPECT_NEAR(channel == 6 ? s.table_accel : s.force[channel - 3], value,
                                kHalfUnitG);
                }
            }
            if (missing) ++incomplete;
        }
        EXPECT_EQ(c.incomplete, incomplete);
        // AND where all frames keep within the join deadline, none that came is missed
        if (trouble.jitter < AssemblerSettings{}.join_deadline) {
            std::uint64_t channels_sent = 0;
            for (const auto& [count, frame] : traffic.sent) {
                channels_sent += static_cast<std::uint64_t>(std::ranges::count(kFrameOf, frame));
            }
            EXPECT_EQ(good_of_sent, channels_sent);
        } else {
            EXPECT_GT(c.late, 0u);
        }
        if (trouble.loss == 0 && trouble.duplicate == 0 && trouble.jitter == 0) {
            EXPECT_EQ(c.samples, kCounts);
            EXPECT_EQ(c.incomplete, 0u);
            EXPECT_EQ(c.late, 0u);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(
    Bus, AssemblerUnderTrouble,
    ::testing::Values(Trouble{"Quiet", 0, 0, 0, 0}, Trouble{"Lossy", 0.1, 0, 0, 0},
                      Trouble{"VeryLossy", 0.6, 0, 0, 0}, Trouble{"Duplicating", 0, 0.2, 0, 0},
                      Trouble{"Reordering", 0, 0, 0, 19 * kMillisecond},
                      Trouble{"Dirty", 0, 0, 0.5, 0},
                      Trouble{"All", 0.1, 0.1, 0.2, 15 * kMillisecond},
                      Trouble{"LateBeyondTheDeadline", 0.05, 0.05, 0.1, 60 * kMillisecond}),
    [](const auto& instance) { return std::string(instance.param.name); });

TEST(AssemblerUnderGarbage, SurvivesRandomFramesOnItsOwnIds) {
    // GIVEN a good bus and a node that sends random bytes of random length on the very same ids
    const unsigned seed = 99;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937 random(seed);
    std::vector<Sample> samples;
    SampleAssembler assembler(rig_dbc(), rig_settings(),
                              [&](const Sample& s) { samples.push_back(s); });
    for (std::uint32_t count = 0; count < 2000; ++count) {
        for (const ReceivedFrame& good : frames_of_count(count, kStart + count * kPeriod)) {
            assembler.feed(good);
            ReceivedFrame bad = good;
            for (std::uint8_t& byte : bad.frame.data) byte = static_cast<std::uint8_t>(random());
            bad.frame.len = static_cast<std::uint8_t>(random() % 9);
            if (random() % 8 == 0) assembler.feed(bad);
        }
    }
    assembler.advance(kNever);
    // THEN every count comes out once, in order and in time, and the counters close
    ASSERT_EQ(samples.size(), 2000u);
    for (std::uint32_t i = 0; i < 2000; ++i) {
        ASSERT_EQ(samples[i].sequence, i);
        ASSERT_EQ(samples[i].time, kStart + i * kPeriod);
    }
    const AssemblerCounters& c = assembler.counters();
    EXPECT_EQ(c.received, c.used + c.unknown + c.duplicate + c.late + c.wrong_length);
    EXPECT_EQ(c.resyncs, 0u);
}

}  // namespace
}  // namespace vibrig::test
