#include "daemon/campaign/in_step_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/stages/dwelling.hpp"
#include "tests/plant/rig.hpp"
#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kHz = 25.1;

/// The simulated rig, bolted hard to its table, shaken at 25.1 Hz.
class ShakenRig {
  public:
    ShakenRig(std::uint64_t seed, double rocking_arcsec_g, double across)
        : rig_([&] {
              plant::Truth truth;
              truth.seed = seed;
              truth.hard = true;
              truth.platform_rocking_arcsec_g = {0, rocking_arcsec_g, 0};
              truth.cross_axis = {across, 0};
              return truth;
          }()) {}

    void go_to(const plant::Vec3& deg) {
        rig_.slew_to(deg);
        for (int i = 0; i < 4000 && !rig_.gimbals().in_position(); ++i) rig_.advance();
        rig_.release();
    }
    void shake(double table_g) {
        const auto amplitude = static_cast<std::uint32_t>(std::lround(table_g * 1e4));
        const std::array<std::uint16_t, 6> words{0,
                                                 25100,
                                                 static_cast<std::uint16_t>(amplitude >> 16),
                                                 static_cast<std::uint16_t>(amplitude),
                                                 100,
                                                 1};
        ASSERT_EQ(rig_.shaker().write(0, words), plant::ShakerController::Answer::accepted);
        for (int i = 0; i < 600; ++i) rig_.advance();
    }
    void rest() {
        const std::array<std::uint16_t, 4> words{0, 0, 100, 0};
        ASSERT_EQ(rig_.shaker().write(2, words), plant::ShakerController::Answer::accepted);
        for (int i = 0; i < 2000; ++i) rig_.advance();
    }
    estimator::LoopReading next() {
        rig_.advance();
        const plant::Readings& seen = rig_.readings();
        estimator::LoopReading out;
        out.time_s = 1e-6 * static_cast<double>(rig_.time_us());
        out.force_g = {seen.raw_g[0], seen.raw_g[1], seen.raw_g[2]};
        for (std::size_t i = 0; i < 3; ++i)
            out.angle_rad[i] = seen.encoder_deg[i] * std::numbers::pi / 180;
        return out;
    }
    void grow(double rocking, double across) { rig_.grow(rocking, across); }

    FoundInStep loop_check(const estimator::Settings& settings) {
        go_to({0, 0, 0});
        shake(0.5);
        std::vector<estimator::LoopReading> readings;
        for (int i = 0; i < 200; ++i) readings.push_back(next());
        rest();
        return {kHz, estimator::in_step(readings, kHz, settings)};
    }

  private:
    plant::Rig rig_;
};

/// What a dwell of 100 s says.
struct Said {
    std::vector<std::string> words;
    int window = 0;  ///< of the first words, from 1; 0: none
};
Said dwell_of(ShakenRig& rig, const FoundInStep& before, const estimator::Settings& settings) {
    InStepWatch watch(settings, 0.025, before, kHz, {3, 3});
    Said said;
    int windows = 0;
    for (int i = 0; i < 4000; ++i) {
        const auto look = watch.add(rig.next());
        if (!look) continue;
        ++windows;
        if (said.window == 0 && !look->said.empty()) said.window = windows;
        for (const auto& words : look->said) said.words.push_back(words);
    }
    EXPECT_EQ(windows, 19);
    return said;
}

TEST(InStepWatch, AnHonestRigSaysNothingInAWholeDwell) {
    const estimator::Settings settings;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        ShakenRig rig(seed, seed % 2 == 0 ? 40 : 0, seed % 3 == 0 ? 0.03 : 0);
        const auto before = rig.loop_check(settings);
        rig.go_to({45, 0, 90});
        rig.shake(seed % 4 < 2 ? 6 : 1);
        EXPECT_THAT(dwell_of(rig, before, settings).words, IsEmpty()) << "seed " << seed;
    }
}

TEST(InStepWatch, FourTimesAsMuchIsSaidOnceAfterOneWindow) {
    const estimator::Settings settings;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        ShakenRig rig(seed, 40, 0.03);
        const auto before = rig.loop_check(settings);
        rig.go_to({45, 0, 90});
        const bool motion = seed % 2 == 0;
        rig.grow(motion ? 4 : 1, motion ? 1 : 4);
        rig.shake(3);
        const auto said = dwell_of(rig, before, settings);
        ASSERT_EQ(said.words.size(), 1U) << "seed " << seed;
        EXPECT_EQ(said.window, 1) << "5 s; seed " << seed;
        EXPECT_THAT(said.words[0], HasSubstr("at 25.1 Hz")) << seed;
        EXPECT_THAT(said.words[0], HasSubstr(motion ? "outer gimbal most" : "goes across it"));
        EXPECT_THAT(said.words[0], HasSubstr("expected "));
        EXPECT_THAT(said.words[0], HasSubstr("limit "));
    }
}

TEST(InStepWatch, WindowsWithTooFewReadingsOrNoVibrationTellNothing) {
    const estimator::Settings settings;
    FoundInStep before{kHz, {}};
    before.found.platform_g = 0.5;
    InStepWatch watch(settings, 0.025, before, kHz, {3, 3});
    for (int i = 0; i < 400; ++i) {
        estimator::LoopReading reading;
        reading.force_g = {0, 1 + std::sin(2 * std::numbers::pi * kHz * 0.2 * i), 0};
        reading.time_s = 0.2 * i;  // one in eight
        EXPECT_FALSE(watch.add(reading));
    }
    InStepWatch standing(settings, 0.025, before, kHz, {3, 3});
    for (int i = 0; i < 400; ++i) {
        estimator::LoopReading reading;
        reading.force_g = {0, 1, 0};
        reading.time_s = 0.025 * i;
        EXPECT_FALSE(standing.add(reading));
    }
}

TEST(InStepWatch, IsHeldAgainstWhatWasFoundAtItsFrequency) {
    estimator::Settings settings;
    settings.frequency_hz = 15;
    const std::vector<FoundInStep> found{{25.1, {}}, {15, {}}};
    EXPECT_EQ(found_at(found, 25.1, settings)->hz, 25.1);
    EXPECT_EQ(found_at(found, 15, settings)->hz, 15);
    EXPECT_EQ(found_at(found, 15.1, settings)->hz, 15) << "stands for the reference";
    EXPECT_FALSE(found_at(found, 35.1, settings));
    EXPECT_FALSE(found_at({}, 15, settings));
}

ProofRecord proof_with(double motion_arcsec_g) {
    ProofRecord record;
    record.by = "Ada";
    record.table_g = 0.5;
    record.passed = true;
    record.transmission = 1;
    record.keys_sha256 = sha256("");
    estimator::InStep found;
    found.platform_g = 0.5;
    found.motion_arcsec_g = motion_arcsec_g;
    found.motion_sigma = 1.2;
    found.cross_share = 0.01;
    found.cross_sigma = 2e-5;
    found.distortion = 0.002;
    record.found(15, found);
    record.found(kHz, found);
    return record;
}

std::string why_not(const std::string& from, const std::string& to) {
    std::string text = to_json(proof_with(40)), why;
    const auto at = text.rfind(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    EXPECT_FALSE(proof_from_json(text, &why)) << text;
    return why;
}

TEST(ProofInStep, SurvivesTheJournal) {
    const auto read = proof_from_json(to_json(proof_with(40)));
    ASSERT_TRUE(read);
    ASSERT_EQ(read->in_step.size(), 2U);
    EXPECT_EQ(read->in_step[1].hz, kHz);
    EXPECT_EQ(read->in_step[1].found.motion_arcsec_g, 40);
    EXPECT_EQ(read->in_step[1].found.motion_sigma, 1.2);
    EXPECT_EQ(read->in_step[1].found.cross_share, 0.01);
    EXPECT_EQ(read->in_step[1].found.distortion, 0.002);
    EXPECT_EQ(to_json(*read), to_json(proof_with(40)));
}

TEST(ProofInStep, AnOldProofIsReadAndHasNone) {
    auto record = proof_with(40);
    record.in_step.clear();
    std::string text = to_json(record);
    const std::string key = "\"in_step\":[],";
    text.erase(text.find(key), key.size());
    const auto read = proof_from_json(text);
    ASSERT_TRUE(read);
    EXPECT_TRUE(read->in_step.empty());
    EXPECT_EQ(read->transmission, 1);
}

TEST(ProofInStep, ADamagedOneIsNamedByPlaceValueAndExpectation) {
    EXPECT_EQ(why_not("\"cross_share\":0.01", "\"cross_share\":null"),
              "in_step[1].cross_share: found null, expected a number from 0");
    EXPECT_EQ(why_not("\"cross_share\":0.01", "\"cross_share\":\"much\""),
              "in_step[1].cross_share: found \"much\", expected a number from 0");
    EXPECT_EQ(why_not("\"motion_arcsec_g\":40.0,", ""),
              "in_step[1].motion_arcsec_g: found nothing, expected a number from 0");
    EXPECT_EQ(why_not("\"motion_sigma\":1.2", "\"motion_sigma\":-1.2"),
              "in_step[1].motion_sigma: found -1.2, expected a number from 0");
    EXPECT_EQ(why_not("\"hz\":25.1", "\"hz\":0"),
              "in_step[1].hz: found 0, expected a number above 0");
    EXPECT_EQ(why_not("\"in_step\":[", "\"in_step\":[3,"),
              "in_step[0].hz: found nothing, expected a number above 0");
    // A number that is none is null in JSON.
    auto record = proof_with(std::numeric_limits<double>::quiet_NaN());
    std::string why;
    EXPECT_FALSE(proof_from_json(to_json(record), &why));
    EXPECT_EQ(why, "in_step[0].motion_arcsec_g: found null, expected a number from 0");
}

TEST(InStepWatch, ReadsSamplesWhoseComingNotifiesNobody) {
    struct Control final : drivers::Waiter {
        int notified = 0;
        void notify() noexcept override { ++notified; }
        bool wait_until(Time) noexcept override { return false; }
    } control;
    const proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    rt::StageFeed feed(dbc, {.block = 4, .velocity = {}}, &control);
    drivers::Sample sample;
    sample.quality.fill(drivers::Quality::good);
    int came = 0;
    for (const auto mode : {rt::StageFeed::Mode::samples, rt::StageFeed::Mode::watched}) {
        feed.order(mode);
        for (int i = 0; i < 10; ++i) feed.take(sample);
        for (rt::Motion motion; feed.pop(motion);) came += motion.good ? 1 : 0;
    }
    EXPECT_EQ(came, 20);
    EXPECT_EQ(control.notified, 10);
}

/// A campaign of two sines, on samples that a test makes.
struct InStepDwellTest : CampaignTest {
    struct GrownRig final : Rig {
        explicit GrownRig(InStepDwellTest& t) : Rig(t.gimbal, t.shaker), test(t) {}
        InStepDwellTest& test;
        drivers::PlatformStatus platform() const override { return test.platform; }
        rt::Rest rest(Time at) const override { return test.accelerometers.monitor.rest(at); }
        void guard(rt::Guard) override {}
        void grown(std::optional<std::array<double, 2>> times) override {
            test.grown.push_back(times);
        }
        std::array<double, 2> grown_limits() const override { return test.limits; }
    } grown_rig{*this};
    rt::StageFeed stage_feed{dbc, {.block = 4, .velocity = {}}, nullptr};
    std::vector<std::optional<std::array<double, 2>>> grown;
    std::array<double, 2> limits{3, 3};
    double across = 0.01;
    Time fed = 0;

    InStepDwellTest() {
        settings.table_g = {9};
        settings.stops = {{{0, 0, 0}, 9}, {{0, 0, 90}, 9}};
        settings.dwell_s = 20;
        settings.frequency_hz = settings.rig.frequency_hz = 15;
        grown_rig.feed = &stage_feed;
    }
    void make_with(std::vector<ProofRecord> proofs_before) {
        campaign = std::make_unique<Campaign>(settings, Ports{grown_rig, dwell_port, log_port});
        campaign->take_over_proofs(std::move(proofs_before));
        static_cast<void>(command(Kind::arm));
        static_cast<void>(command(Kind::start));
    }
    /// Samples at 40/s until the campaign is over.
    void run() {
        for (int i = 0; i < 3000 && status().state != CampaignState::finished; ++i) {
            for (Time t = now + 25 * kMillisecond; t <= now + 100 * kMillisecond;
                 t += 25 * kMillisecond) {
                drivers::Sample sample;
                sample.time = t;
                const double wave = std::sin(2 * std::numbers::pi * 15 * drivers::to_seconds(t)) *
                                    shaker.now.measured_g;
                sample.force = {across * wave, 1 + wave, 0};
                sample.quality.fill(drivers::Quality::good);
                stage_feed.take(sample);
            }
            run_rig();
        }
        EXPECT_EQ(status().state, CampaignState::finished) << status().reason;
    }
    int count(const char* words) const {
        return static_cast<int>(std::ranges::count_if(
            events, [&](const auto& text) { return text.find(words) != std::string::npos; }));
    }
};

TEST_F(InStepDwellTest, EachDwellIsWatchedAndSaysItsOwn) {
    across = 0.06;
    make_with({proof_with(0)});
    run();
    // Four windows of 5 s, the last of which may be cut, and the end, of each of two dwells.
    EXPECT_EQ(std::ranges::count(grown, false, [](const auto& one) { return one.has_value(); }), 2);
    EXPECT_GE(grown.size(), 8U);
    EXPECT_EQ(count("at 15 Hz 0.06 of the motion along the vertical goes across it, expected 0.01"),
              2)
        << "once a dwell";
    EXPECT_GT((*grown.front())[1], 3);
    EXPECT_LT((*grown.front())[0], 3);
    EXPECT_FALSE(grown.back());
}

TEST_F(InStepDwellTest, WhatIsAsItWasIsNotSaid) {
    make_with({proof_with(0)});
    run();
    EXPECT_EQ(count("as at the loop check"), 0);
    EXPECT_GE(grown.size(), 8U);
}

TEST_F(InStepDwellTest, FastSamplesAreFetchedBeforeTheirRoomIsFull) {
    settings.sample_s = 1e-4;
    make_with({proof_with(0)});
    while (status().state != CampaignState::recording && drivers::to_seconds(now) < 200) run_rig();
    ASSERT_EQ(status().state, CampaignState::recording);
    EXPECT_LE(drivers::to_seconds(campaign->step(now) - now) / settings.sample_s,
              static_cast<double>(rt::StageFeed::kCapacity) / 2);
}

TEST_F(InStepDwellTest, AnotherLimitIsKeptTo) {
    across = 0.06;
    limits = {3, 20};
    make_with({proof_with(0)});
    run();
    EXPECT_EQ(count("as at the loop check"), 0);
}

TEST_F(InStepDwellTest, WithoutWhatWasFoundNothingIsWatchedAndThatIsSaidOnce) {
    across = 0.06;
    auto old = proof_with(0);
    old.in_step.clear();
    make_with({old});
    run();
    EXPECT_THAT(grown, IsEmpty());
    EXPECT_EQ(count("no motion in step was measured"), 1);
    EXPECT_EQ(count("as at the loop check"), 0);
}

}  // namespace
}  // namespace vibrig::campaign
