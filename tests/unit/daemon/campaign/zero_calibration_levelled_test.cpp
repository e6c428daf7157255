// Levelling and zeroing on the simulated rig, which is written without the estimator, over seeds.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/daemon/campaign/rig_at_rest.hpp"

namespace vibrig::campaign {
namespace {

constexpr double kRadPerArcsec = std::numbers::pi / 180 / 3600;

/// 99.9 % point of chi-square; Wilson and Hilferty.
double chi_square_999(double freedom) {
    const double k = 2 / (9 * freedom);
    return freedom * std::pow(1 - k + 3.0902 * std::sqrt(k), 3);
}

struct Draw {
    double slew_error_deg = 0;       ///< of where slews end, 1 sigma
    double misalignment_arcsec = 0;  ///< of each accelerometer towards each axis, 1 sigma
    bool both_ways = true;
    bool second_axis = false;
};

/// Accelerometer zeros of up to 5 mg, levelled first.
void expect_honest_zeros(std::uint64_t seeds, const Draw& draw) {
    double squares = 0, freedom = 0;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed << ", slew error " << draw.slew_error_deg
                                        << " deg, " << draw.misalignment_arcsec << " arcsec");
        std::mt19937_64 generator(seed);
        std::uniform_real_distribution<double> within(-5e-3, 5e-3);
        std::normal_distribution<double> normal;
        plant::Truth truth;
        truth.seed = seed;
        truth.slew_error_deg = draw.slew_error_deg;
        for (double& zero : truth.zero_g) zero = within(generator);
        const double sample_s = 1 / truth.sample_rate_hz;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j) {
                if (i != j)
                    truth.matrix[i][j] =
                        draw.misalignment_arcsec * kRadPerArcsec * normal(generator);
            }
        }
        PositionLeveller levelling({}, {}, sample_s, 3000);
        ZeroingSettings settings;
        settings.both_ways = draw.both_ways;
        settings.second_axis = draw.second_axis;
        ZeroCalibration zeroing(settings, {}, sample_s);
        RigAtRest rig(truth);
        zeroing.begin();
        ASSERT_EQ(rig.zero_all(zeroing, &levelling), "");
        ASSERT_EQ(zeroing.finish(false), "");
        const ZeroStatus found = zeroing.status();
        // One way z has 1 g of the scale's share in it, which is declared and not there.
        for (std::size_t i = 0; i < (draw.both_ways || draw.second_axis ? 3U : 2U); ++i) {
            const double off = found.zero_mg[i] - 1e3 * truth.zero_g[i];
            squares += std::pow(off / found.sigma_mg[i], 2);
            freedom += 1;
        }
    }
    // The stillness of the platform is given as a bound: the errors may be smaller, not larger.
    EXPECT_LT(squares, chi_square_999(freedom))
        << "seeds 1 to " << seeds << ", slew error " << draw.slew_error_deg << " deg, "
        << draw.misalignment_arcsec << " arcsec";
}

TEST(LevelledZeros, AreWithinTheirSigmaWhereverTheSlewsEndAndHoweverTheAxesLie) {
    expect_honest_zeros(20, {0.02, 0, false});
    expect_honest_zeros(20, {0.2, 50, false});
    // Levelled by accelerometers that are 5 mg off the platform stands 17' off level, and z shows
    // its misalignment's share of that: as large as declared.
    expect_honest_zeros(20, {0.2, 50, true});
}

TEST(LevelledZeros, AboutASecondAxisTheyAreWithinTheirSigmaWhereZCannotBeDown) {
    expect_honest_zeros(20, {0.2, 50, false, true});
}

TEST(LevelledZerosSoak, AHundredSeedsAreWithinTheirSigma) {
    for (const double error : {0.0, 0.02, 0.05, 0.1, 0.2}) {
        expect_honest_zeros(100, {error, 0, false});
        for (const double arcsec : {0.0, 10.0, 50.0})
            expect_honest_zeros(100, {error, arcsec, true});
        expect_honest_zeros(100, {error, 50, false, true});
    }
}

}  // namespace
}  // namespace vibrig::campaign
