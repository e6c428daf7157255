#include <cmath>
#include <fstream>
#include <string>

#include "tests/unit/daemon/configuration/spectrum_keys.hpp"
#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::configuration {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(SpectrumKeys, AProfileBeyondTheShakerOrTheAccelerometersIsRefusedByTheDaemon) {
    // The truck type at a hard mount: 3 sigma are 3.1 g, 0.17 m/s and 1.66 mm.
    const std::string truck =
        "psd = [[10, 0.015], [40, 0.015], [500, 0.00015]]\n[spectrum]\nmount = \"hard\"\n";
    const auto said = [&](const std::string& more) {
        return complaint(profile_with(truck) + more, true);
    };
    EXPECT_EQ(said(""), "");
    EXPECT_THAT(said("[shaker.limits]\nacceleration_g = 3\n"),
                AllOf(HasSubstr("profile[0] (p): found peaks of 3 sigma of 3.128"),
                      HasSubstr("shaker.limits.acceleration_g")));
    EXPECT_THAT(said("[shaker.limits]\nvelocity_mps = 0.1\n"), HasSubstr("3 sigma of 0.166"));
    EXPECT_THAT(said("[shaker.limits]\ndisplacement_mm = 1\n"), HasSubstr("3 sigma of 1.6"));
    // 1 + 5 * 1.0429 g
    EXPECT_THAT(said("[accelerometer]\nrange_g = 6\n"),
                AllOf(HasSubstr("5 sigma of 6.21"), HasSubstr("accelerometer.range_g")));
    EXPECT_EQ(said("[accelerometer]\nrange_g = 6.3\n"), "");
    // Minimum integrity: 23 g, 6 dB too much.
    EXPECT_THAT(complaint(profile_with("psd = [[20, 0.04], [1000, 0.04], [2000, 0.01]]\n"
                                       "[spectrum]\nmount = \"hard\"\n"),
                          true),
                AllOf(HasSubstr("3 sigma of 23.0"), HasSubstr("-5.6")));
}

TEST(SpectrumKeys, FrequenciesThatSamplingForbidsAreRefusedWithTheNearestFreeOne) {
    EXPECT_THAT(complaint("vibration.frequency_hz = 60\n", true),
                AllOf(HasSubstr("found 60 Hz"), HasSubstr("nearest free one is 60.2 Hz")));
    const TemporaryFolder folder;
    const auto plan_at = [&](const std::string& hz) {
        const std::string path = folder.file("plan.json");
        std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3,"frequency_hz":)" << hz
                            << "}]}";
        return complaint("campaign.plan = \"" + path + "\"\n", true);
    };
    EXPECT_THAT(plan_at("60"), AllOf(StartsWith("rig.toml:1:"), HasSubstr("found dwell 1 at 60 Hz"),
                                     HasSubstr("the nearest free one is 60.2 Hz")));
    EXPECT_THAT(plan_at("10.7"), HasSubstr("below it the isolators amplify"));
    EXPECT_THAT(plan_at("35.1"), HasSubstr("no dwell to identify at 15 Hz within 2 %"));
    EXPECT_EQ(plan_at("15"), "");
    EXPECT_THAT(complaint("spectrum.mode = \"mixed\"\n", true),
                HasSubstr("found \"mixed\" without registers of mode and profile"));
}

/// Below half of a line's power, and where the table does not reach.
TEST(AccelerometerKeys, WhatTheyHardlySeeIsRefused) {
    EXPECT_THAT(complaint("accelerometer.bandwidth_hz = 14\n", false),
                AllOf(HasSubstr("accelerometer.bandwidth_hz: found 15 Hz, of which the "
                                "accelerometers see 0.465"),
                      HasSubstr("half of the power at least")));
    EXPECT_EQ(complaint("accelerometer.bandwidth_hz = 15\n", false), "");
    const TemporaryFolder folder;
    const auto plan_with = [&](const std::string& run, const std::string& more) {
        const std::string path = folder.file("plan.json");
        std::ofstream(path) << R"({"runs":[{"position":[0,0,0],"table_g":3},{"position":[0,0,0],)"
                            << run << "}]}";
        return "spectrum.mount = \"hard\"\ncampaign.plan = \"" + path + "\"\n" + more;
    };
    const auto said = [&](const std::string& run, const std::string& more) {
        return complaint(plan_with(run, more), true);
    };
    const std::string high = R"("table_g":3,"frequency_hz":125.1)";
    EXPECT_THAT(said(high, "accelerometer.bandwidth_hz = 100\n"),
                AllOf(HasSubstr("found dwell 2 at 125.1 Hz"),
                      HasSubstr("of which the accelerometers see 0.389")));
    EXPECT_THAT(said(high, "accelerometer.response = [[10, 1], [100, 0.9]]\n"),
                HasSubstr("of which the accelerometers see 0"));
    EXPECT_EQ(said(high, "accelerometer.bandwidth_hz = 130\n"), "");
    // What the witnesses expect is what the accelerometers show.
    const auto c = accepted(plan_with(high, "accelerometer.bandwidth_hz = 130\n"), true);
    const double power = 1 / (1 + std::pow(125.1 / 130, 2));
    EXPECT_NEAR(c.campaign.stops[1].transmission, std::sqrt(power), 1e-12);
    EXPECT_NEAR(c.campaign.stops[0].transmission, 1 / std::sqrt(1 + std::pow(15.0 / 130, 2)),
                1e-12);
    // 20 to 120 Hz: 100 (atan 1.2 - atan 0.2) / 100 of it with 100 Hz, 0.68.
    const std::string random = R"("profile":"p")";
    const auto with = [&](const std::string& hz) {
        return "spectrum.mode = \"mixed\"\naccelerometer.bandwidth_hz = " + hz + "\n" +
               kRandomRegisters +
               profile_with("number = 4\nat = \"table\"\npsd = [[20, 0.02], [120, 0.02]]\n");
    };
    EXPECT_THAT(said(random, with("40")),
                AllOf(HasSubstr("profile[0] (p): found a vibration of which the accelerometers "
                                "see 0.3"),
                      HasSubstr("half of its power at least")));
    const auto r = accepted(plan_with(random, with("100")), true);
    const double share = std::atan(1.2) - std::atan(0.2);
    ASSERT_EQ(r.estimator.seen_profiles.size(), 1U);
    EXPECT_EQ(r.estimator.seen_profiles[0].first, 4);
    EXPECT_NEAR(r.estimator.seen_profiles[0].second.share, share, 1e-4);
    EXPECT_NEAR(r.campaign.stops[1].transmission, std::sqrt(share), 1e-4);
}

TEST(SpectrumKeys, APlanWithASweepNeedsRegistersRateAndLimits) {
    const TemporaryFolder folder;
    const std::string plan = folder.file("plan.json");
    const auto text = [&](const std::string& sweep, double table_g, const std::string& more) {
        std::ofstream(plan) << R"({"runs":[{"position":[0,0,0],"table_g":6,"frequency_hz":15},)"
                            << R"({"position":[0,0,45],"table_g":)" << table_g << R"(,"sweep":{)"
                            << sweep << "}}]}";
        return "campaign.plan = \"" + plan + "\"\n" + more;
    };
    const std::string up = R"("from_hz":20,"to_hz":120,"s":300)";
    const std::string whole = std::string(kSweepRegisters) + "spectrum.mode = \"mixed\"\n" +
                              "spectrum.mount = \"hard\"\ncan.sample_rate_hz = 400\n";
    const auto c = accepted(
        text(up, 6, whole + "accelerometer.bandwidth_hz = 200\naccelerometer.order = 2\n"), true);
    ASSERT_EQ(c.campaign.stops.size(), 2U);
    const auto& stop = c.campaign.stops[1];
    EXPECT_EQ(stop.sweep, (estimator::SweptSine{20, 120, 300}));
    EXPECT_EQ(stop.frequency_hz, 0);
    EXPECT_FALSE(stop.random);
    EXPECT_NE(stop.kind(), c.campaign.stops[0].kind());
    // What the accelerometers show along it: Butterworth, order 2, 200 Hz.
    EXPECT_NEAR(stop.along.front(), 1 / std::sqrt(1 + std::pow(0.1, 4)), 1e-9);
    EXPECT_NEAR(stop.along.back(), 1 / std::sqrt(1 + std::pow(0.6, 4)), 1e-9);
    EXPECT_GT(stop.along[4], stop.along.back());

    const auto said = [&](const std::string& sweep, double table_g, const std::string& more) {
        return complaint(text(sweep, table_g, more), true);
    };
    EXPECT_EQ(said(up, 6, whole), "");
    EXPECT_THAT(said(up, 6, "spectrum.mount = \"hard\"\ncan.sample_rate_hz = 400\n"),
                HasSubstr("a sweep from 20 to 120 Hz without registers for it, expected "
                          "shaker.registers.mode, sweep_from"));
    EXPECT_THAT(said(up, 6, std::string(kSweepRegisters) + "spectrum.mount = \"hard\"\n"),
                HasSubstr("spectrum.mode \"mixed\" for sweeps"));
    EXPECT_THAT(said(up, 6,
                     std::string(kSweepRegisters) +
                         "spectrum.mode = \"mixed\"\nspectrum.mount = \"hard\"\n"),
                HasSubstr("at 40 samples/s, expected 100 at least"));
    EXPECT_THAT(said(R"("from_hz":8,"to_hz":120,"s":300)", 6, whole),
                HasSubstr("at 6 g, expected 3.0917 g at most, at 8 Hz"));
    EXPECT_THAT(said(R"("from_hz":120,"to_hz":5,"s":300)", 2, whole), HasSubstr("g at most, at"));
    EXPECT_THAT(said(up, 0, whole), HasSubstr("at 0 g, expected a level"));
    // Where it ends it stays: there a shaking table must not show as a standing one.
    const std::string slower =
        whole.substr(0, whole.rfind("can.sample_rate_hz")) + "can.sample_rate_hz = 100\n";
    for (const char* ends :
         {R"("from_hz":20,"to_hz":100,"s":300)", R"("from_hz":100,"to_hz":20,"s":300)",
          R"("from_hz":20,"to_hz":50,"s":300)"})
        EXPECT_THAT(said(ends, 3, slower),
                    HasSubstr("until the dwell ends, shows as a standing table does"))
            << ends;
    EXPECT_EQ(said(R"("from_hz":20,"to_hz":95,"s":300)", 3, slower), "");
    EXPECT_THAT(said(R"("from_hz":20,"to_hz":120,"s":80000)", 6, whole),
                HasSubstr("in 80000 s, 0.0019387 octaves a minute, expected 0.01 at least"));
    EXPECT_THAT(said(up, 6, whole + "accelerometer.bandwidth_hz = 60\n"),
                HasSubstr("expected frequencies of which they see half of the power at least"));
    EXPECT_THAT(said(up, 6, whole + "estimator.method = \"two-step\"\n"),
                HasSubstr("the two-step route has coefficients at one frequency only"));
    // Isolators amplify below sqrt 2 of their own frequency.
    EXPECT_THAT(said(R"("from_hz":9,"to_hz":120,"s":300)", 1,
                     std::string(kSweepRegisters) +
                         "spectrum.mode = \"mixed\"\ncan.sample_rate_hz = 400\n"),
                HasSubstr("below it the isolators amplify"));
}

}  // namespace
}  // namespace vibrig::configuration
