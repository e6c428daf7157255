// Levelling and zeroing on the simulated rig, which is written without the estimator, over seeds.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/daemon/campaign/rig_at_rest.hpp"

namespace vibrig::campaign {
namespace {

/// 99.9 % point of chi-square; Wilson and Hilferty.
double chi_square_999(double freedom) {
    const double k = 2 / (9 * freedom);
    return freedom * std::pow(1 - k + 3.0902 * std::sqrt(k), 3);
}

/// Accelerometer zeros of up to 5 mg, slews that end up to `slew_error_deg` (1 sigma) beside their
/// targets, levelled first.
void expect_honest_zeros(std::uint64_t seeds, double slew_error_deg) {
    double squares = 0;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed << ", slew error " << slew_error_deg);
        std::mt19937_64 generator(seed);
        std::uniform_real_distribution<double> within(-5e-3, 5e-3);
        plant::Truth truth;
        truth.seed = seed;
        truth.slew_error_deg = slew_error_deg;
        for (double& zero : truth.zero_g) zero = within(generator);
        const double sample_s = 1 / truth.sample_rate_hz;
        LevellingStage levelling({}, {}, sample_s, 3000);
        ZeroingStage zeroing({}, {}, sample_s);
        RigAtRest rig(truth);
        zeroing.begin();
        ASSERT_EQ(rig.zero(zeroing, &levelling), "");
        ASSERT_EQ(zeroing.finish(false), "");
        const ZeroStatus found = zeroing.status();
        for (std::size_t i = 0; i < 2; ++i) {
            const double off = found.zero_mg[i] - 1e3 * truth.zero_g[i];
            squares += std::pow(off / found.sigma_mg[i], 2);
        }
    }
    // The stillness of the platform is given as a bound: the errors may be smaller, not larger.
    EXPECT_LT(squares, chi_square_999(2.0 * static_cast<double>(seeds)))
        << "seeds 1 to " << seeds << ", slew error " << slew_error_deg;
}

TEST(LevelledZeros, AreWithinTheirSigmaWhereverTheSlewsEnd) {
    expect_honest_zeros(20, 0.02);
    expect_honest_zeros(20, 0.2);
}

TEST(LevelledZerosSoak, AHundredSeedsAreWithinTheirSigmaWhereverTheSlewsEnd) {
    for (const double error : {0.0, 0.02, 0.05, 0.1, 0.2}) expect_honest_zeros(100, error);
}

}  // namespace
}  // namespace vibrig::campaign
