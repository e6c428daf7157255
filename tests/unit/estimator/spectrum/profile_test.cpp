#include "estimator/spectrum/profile.hpp"
#include "estimator/level/random_level.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/sampling.hpp"

namespace vibrig::estimator::spectrum {
namespace {

constexpr Resonance kGolden{60, 0.05};

double effective(const Profile& profile, int per_decade) {
    return 1 + elastic_weight(bands_of(profile, per_decade), kGolden);
}

TEST(InPhase, OfOneResonanceIsAsPublished) {
    const std::array<std::pair<double, double>, 6> golden{{{15, 1.065908687},
                                                           {35, 1.504030538},
                                                           {55, 4.709629714},
                                                           {65, -4.145746004},
                                                           {101.3, -0.535942019},
                                                           {500, -0.014608224}}};
    for (const auto& [hz, value] : golden) EXPECT_NEAR(in_phase(hz, kGolden), value, 6e-10) << hz;
}

TEST(Profiles, BuiltInOnesHaveTheirPublishedPower) {
    const auto all = built_in_profiles();
    ASSERT_EQ(all.size(), 2U);
    EXPECT_NEAR(std::sqrt(mean_square(all[0])), 7.694154, 1e-6);
    EXPECT_NEAR(std::sqrt(mean_square(all[1])), 1.042917, 1e-6);
    EXPECT_NEAR(effective(all[0], 800), -0.012320, 1e-5);
    EXPECT_NEAR(effective(all[1], 800), 0.709391, 1e-5);
}

TEST(Profiles, BandsOfATwentyFourthOfAnOctaveAreFineEnough) {
    const Profile flat{"flat", {{20, 0.05}, {200, 0.05}}, {}, {0, 1, 0}, 0};
    EXPECT_NEAR(effective(flat, 800), -0.012, 1e-3);
    EXPECT_NEAR(effective(flat, 100), effective(flat, 3200), 1e-3);
    double shares = 0;
    for (const Band& band : bands_of(flat, 100)) shares += band.share;
    EXPECT_NEAR(shares, 1, 1e-12);
}

std::string refusal(const Profile& profile) {
    try {
        check(profile, "p.json: ");
    } catch (const SettingsError& error) {
        return error.what();
    }
    return "";
}

TEST(Profiles, ThatCannotBeAreRefusedByElementAndValue) {
    EXPECT_EQ(refusal({"", {{60, 1}, {40, 1}}, {}, {0, 1, 0}, 0}),
              "p.json: psd[1]: found 40 Hz after 60 Hz, expected growing frequencies");
    EXPECT_EQ(refusal({"", {{20, 0}, {40, 1}}, {}, {0, 1, 0}, 0}),
              "p.json: psd[0]: found 0 g^2/Hz, expected a density above 0");
    EXPECT_EQ(refusal({"", {{20, 1}, {40, -0.5}}, {}, {0, 1, 0}, 0}),
              "p.json: psd[1]: found -0.5 g^2/Hz, expected a density above 0");
    EXPECT_EQ(refusal({"", {{20, 0.05}, {40, 0.05}}, {}, {0, 1, 0}, 2}),
              "p.json: g_rms: found 2, expected that of the table within 1 %: 1");
    EXPECT_EQ(refusal({"", {{20, 0.05}, {40, 0.05}}, {}, {0, 1, 0}, 1.009}), "");
    EXPECT_NE(refusal({"", {}, {}, {0, 1, 0}, 0}).find("neither breakpoints nor sines"),
              std::string::npos);
    EXPECT_NE(refusal({"", {}, {{-5, 1}}, {0, 1, 0}, 0}).find("sines[0]"), std::string::npos);
}

TEST(Profiles, OneFrequencyIsOneSine) {
    // Of two in phase the mean square is (3 + 2)^2 / 2, not 3^2 / 2 + 2^2 / 2.
    EXPECT_EQ(refusal({"", {}, {{55, 3}, {20, 1}, {55, 2}}, {0, 1, 0}, 0}),
              "p.json: sines[2]: found 55 Hz as in [0], expected one sine of that frequency with "
              "the peak of their sum, 5 g where they are in phase or their phase is not known");
    EXPECT_NE(refusal({"", {}, {{55.001, 3}, {55, 2}}, {0, 1, 0}, 0}), "") << "they beat in 1000 s";
    EXPECT_EQ(refusal({"", {}, {{55.1, 3}, {55, 2}}, {0, 1, 0}, 0}), "");
}

TEST(Sampling, WholeFrequenciesThatAreClosedAreThePublishedOnes) {
    const auto closed = [](double sample_hz) {
        std::vector<int> out;
        for (int hz = 5; hz <= 120; ++hz) {
            if (forbidden(hz, sample_hz, 10)) out.push_back(hz);
        }
        return out;
    };
    EXPECT_EQ(closed(40), (std::vector<int>{8,  10, 16, 20, 24, 30, 32, 40,  48,  50,  56,  60,
                                            64, 70, 72, 80, 88, 90, 96, 100, 104, 110, 112, 120}));
    EXPECT_EQ(closed(100), (std::vector<int>{20, 25, 40, 50, 60, 75, 80, 100, 120}));
    EXPECT_TRUE(closed(1000).empty());
    EXPECT_NEAR(nearest_free(60, 40, 10).value_or(0), 60.2, 1e-9);
    for (const double hz : {15.1, 25.1, 35.1, 45.1, 65.1, 85.1, 125.1})
        EXPECT_FALSE(forbidden(hz, 40, 10, kHarmonicsPlanned)) << hz;
    EXPECT_TRUE(forbidden(15, 40, 10, kHarmonicsPlanned));
}

TEST(Sampling, WhatIsOfferedIsFreeWhereAnythingIs) {
    for (const double sample_hz : {8.0, 10.0, 12.5, 40.0, 1000.0}) {
        for (const double window_s : {2.0, 3.0, 5.0, 10.0}) {
            // GIVEN a rate and a window that leave something free, or nothing
            bool any = false;
            for (int k = 1; k <= 10 * sample_hz; ++k)
                any = any || !forbidden(k * 0.1, sample_hz, window_s);
            for (const double hz : {15.0, 15.3, 16.0, 60.0}) {
                // WHEN the nearest free frequency is asked for
                const auto free = nearest_free(hz, sample_hz, window_s);
                // THEN it is one, or there is none
                ASSERT_EQ(free.has_value(), any) << sample_hz << " Hz, " << window_s << " s";
                if (free) {
                    EXPECT_FALSE(forbidden(*free, sample_hz, window_s)) << *free;
                }
            }
        }
    }
    // AND a window in which eight harmonics find no room has a frequency of which five do
    EXPECT_FALSE(nearest_free(15.3, 8, 3));
    EXPECT_NE(nearest_free_words(15.3, 8, 3).find("none is free"), std::string::npos);
    EXPECT_NEAR(nearest_free(16, 8, 4).value_or(0), 17, 1e-9);
}

TEST(Sampling, SlowSamplesAreIndependentAndFastOnesKnowEverything) {
    EXPECT_NEAR(realised_error(4000, 40, 200), 0.0224, 5e-5);
    EXPECT_EQ(realised_error(40000, 400, 200), 0);
    EXPECT_NEAR(realised_error(125000, 1250, 2000), 0.004, 1e-12);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
