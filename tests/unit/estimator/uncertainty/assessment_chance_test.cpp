// What moves by chance, from samples with their noise: a campaign of the independent plant for each
// seed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iostream>
#include <string>

#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/uncertainty/from_samples.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::balanced_schedule;
using estimator::testing::balanced_schedule_with_rest;
using estimator::testing::Schedule;

struct Chance {
    double rms = 0;  ///< of errors in u_A
    std::array<int, 3> levels{};
    int reported = 0;  ///< campaigns with a reason of this code
};

Chance over_seeds(int seeds, const std::function<void(plant::Truth&)>& change,
                  const std::string& code, const Settings& settings = {},
                  const Schedule& schedule = balanced_schedule()) {
    Chance out;
    for (int seed = 1; seed <= seeds; ++seed) {
        plant::Truth truth;
        truth.seed = static_cast<std::uint64_t>(seed);
        truth.frequency_hz = settings.frequency_hz;
        change(truth);
        const auto rig = from_samples(settings, truth, schedule);
        const Assessment a = assess(settings, rig.result);
        ++out.levels[static_cast<std::size_t>(a.verdict.level)];
        bool reported = false;
        for (const Reason& reason : a.verdict.reasons) reported = reported || reason.code == code;
        out.reported += reported ? 1 : 0;
        for (std::size_t i = 0; i < kParameters; ++i) {
            const auto& c = a.coefficients[i];
            out.rms += std::pow((c.value - rig.truth[i]) / c.u_a, 2) / (seeds * 30.0);
        }
    }
    out.rms = std::sqrt(out.rms);
    return out;
}

/// `least`: of 20 with one of `levels`.
void expect_by_chance(const char* what, const Chance& c, const std::string& levels, double most_rms,
                      int seeds = 20) {
    int fitting = 0;
    for (std::size_t l = 0; l < 3; ++l) {
        if (levels.find("VDN"[l]) != std::string::npos) fitting += c.levels[l];
    }
    std::cout << what << ", seeds 1 to " << seeds << ": rms " << c.rms << ", V D N " << c.levels[0]
              << " " << c.levels[1] << " " << c.levels[2] << ", reported " << c.reported << '\n';
    EXPECT_GE(fitting, seeds - seeds / 20) << what;
    EXPECT_LE(c.rms, most_rms) << what;
}

void markov(plant::Truth& t, double size, double constant_s) {
    t.bias_markov_deg_h = size;
    t.bias_markov_s = constant_s;
}

TEST(ByChance, SoakOfRowsWhoseBiasMoves) {
    const auto row = [](const char* what, const std::string& levels,
                        const std::function<void(plant::Truth&)>& change,
                        const Schedule& schedule = balanced_schedule()) {
        expect_by_chance(what, over_seeds(20, change, "", {}, schedule), levels, 1.2);
    };
    const auto walk = [](double size) {
        return [size](plant::Truth& t) { t.bias_walk_deg_h_rt_h = size; };
    };
    row("clean", "V", [](plant::Truth&) {});
    row("bias walk 0.003", "VD", walk(0.003));
    row("bias walk 0.01", "VD", walk(0.01));
    row("bias walk 0.03", "D", walk(0.03));
    row("scatter 0.01", "D", [](plant::Truth& t) { t.bias_scatter_deg_h = 0.01; });
    row("scatter 0.03", "DN", [](plant::Truth& t) { t.bias_scatter_deg_h = 0.03; });
    row("Markov 0.01, 30 s", "VD", [](plant::Truth& t) { markov(t, 0.01, 30); });
    row("Markov 0.02, 300 s", "D", [](plant::Truth& t) { markov(t, 0.02, 300); });
    const auto step_and_walk = [](plant::Truth& t) {
        t.bias_step_deg_h = {0.1, 0.1, 0.1};
        t.step_after_dwell = 14;
        t.bias_walk_deg_h_rt_h = 0.02;
    };
    const auto cross_and_walk = [](plant::Truth& t) {
        t.cross_axis = {0, 0.1};
        t.bias_walk_deg_h_rt_h = 0.03;
    };
    row("step 0.1 and walk 0.02", "D", step_and_walk);
    row("cross E 10 % and walk 0.03", "D", cross_and_walk);
    const Schedule rest = balanced_schedule_with_rest();
    row("bias walk 0.03, 9/0", "D", walk(0.03), rest);
    row("step 0.1 and walk 0.02, 9/0", "D", step_and_walk, rest);
    row("cross E 10 % and walk 0.03, 9/0", "D", cross_and_walk, rest);
}

constexpr double kAzimuth_deg = 0.2;

/// Harmonics of 5 % that alias onto the vibration itself: at a third of the sample rate the second,
/// at a quarter the third.
Chance aliased(int seeds, double frequency_hz, double azimuth_deg = 0) {
    Settings settings;
    settings.frequency_hz = frequency_hz;
    return over_seeds(
        seeds,
        [=](plant::Truth& t) {
            t.second_harmonic = 0.05;
            t.third_harmonic = frequency_hz > 11 ? 0 : 0.05;
            t.azimuth_deg = azimuth_deg;
        },
        "dwell", settings);
}

Chance noisier(int seeds, double gyro, double resolver) {
    return over_seeds(
        seeds,
        [=](plant::Truth& t) {
            t.gyro_random_walk_deg_per_rt_h *= gyro;
            t.resolver_arcsec *= resolver;
        },
        gyro > 1 ? "gyro noise" : "dwell");
}

/// Of angle noise twice as large nothing is seen in the dwells' scatter but what the rate's
/// variance grows by: the encoders' part of it, at most 1 - 0.0036^2/v, four times.
const double kRmsOfAngles = std::sqrt(1 + 3 * (1 - 3.6e-5 / 4.891201e-5));

TEST(ByChance, HarmonicsThatAliasAndNoiseThatIsWrongAreDoubtful) {
    const Chance third_of_rate = aliased(2, 40.0 / 3);
    EXPECT_EQ(third_of_rate.reported, 2);
    EXPECT_EQ(third_of_rate.levels[0], 0);
    expect_by_chance("a quarter of the sample rate", aliased(2, 10), "D", 1.8, 2);
    // The third harmonic stands still at a third of the sample rate: 0.05 * 6 g sin(phase) over
    // gravity. Beyond 2 % of it no dwell is taken at all.
    Settings third;
    third.frequency_hz = 40.0 / 3;
    const Chance still = over_seeds(
        1, [](plant::Truth& t) { t.third_harmonic = 0.05; }, "dwell", third);
    EXPECT_EQ(still.levels[2], 1);
    expect_by_chance("gyro noise 2 times", noisier(2, 2, 1), "D", 1.5, 2);
    expect_by_chance("resolver noise 2 times", noisier(2, 1, 2), "D", 1.3 * kRmsOfAngles, 2);
}

TEST(ByChance, SoakOfHarmonicsThatAliasAndNoiseThatIsWrong) {
    for (const double frequency_hz : {40.0 / 3, 10.0}) {
        const Chance c = aliased(20, frequency_hz);
        expect_by_chance(frequency_hz > 11 ? "f = fs/3" : "f = fs/4", c, "D", 1.2);
        EXPECT_EQ(c.reported, 20);
    }
    // What the levels do passes for nothing else, and what is wrong besides is seen all the same.
    expect_by_chance("f = fs/3, azimuth 12 arcmin", aliased(20, 40.0 / 3, kAzimuth_deg), "N", 1e9);
    const Chance gyro = noisier(20, 2, 1);
    expect_by_chance("gyro noise 2 times", gyro, "D", 1.2);
    const Chance resolver = noisier(20, 1, 2);
    expect_by_chance("resolver noise 10 arcsec", resolver, "D", std::max(1.2, kRmsOfAngles));
    EXPECT_GE(resolver.reported, 19);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
