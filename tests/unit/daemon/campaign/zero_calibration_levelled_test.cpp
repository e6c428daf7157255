// Levelling and zeroing on the simulated rig, which is written without the estimator, over seeds.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/daemon/campaign/rig_at_rest.hpp"

namespace vibrig::campaign {
namespace {

constexpr double kRadPerArcsec = std::numbers::pi / 180 / 3600;

/// 99.9 % and 0.1 % points of chi-square; Wilson and Hilferty.
double chi_square_999(double freedom) {
    const double k = 2 / (9 * freedom);
    return freedom * std::pow(1 - k + 3.0902 * std::sqrt(k), 3);
}

double chi_square_001(double freedom) {
    const double k = 2 / (9 * freedom);
    return freedom * std::pow(1 - k - 3.0902 * std::sqrt(k), 3);
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

/// Zeros where next to nothing but the noise of the accelerometers' samples matters, at their rate.
class ZerosAtARate : public testing::TestWithParam<double> {
  protected:
    static constexpr double kNoise_g = 2e-3;  ///< of a sample, white
    static constexpr double kRun_s = 60;      ///< each way
    static constexpr double kSlew_deg_s = 7;  ///< increments have room for 7.28

    ZerosAtARate() {
        settings_.sample_s = 1 / GetParam();
        settings_.zero.duration_s = kRun_s;
        settings_.zero.slew_deg_per_s = kSlew_deg_s;
        settings_.zero.velocity_reference_mps = 1e-4;
        settings_.zero.position_reference_m = 1;
        settings_.zero.target_mg = {5, 5, 5};
        settings_.rig.accelerometer_g = kNoise_g;
        truth_.sample_rate_hz = GetParam();
        truth_.accelerometer_g = kNoise_g;
        truth_.slew_deg_per_s = kSlew_deg_s;
        truth_.slew_kick_g = 0;
    }

    /// Of a level accelerometer's zero over that of a mean: it has to be distinguished from a tilt
    /// that turns beneath it. By least squares c of c + A exp(-i psi) has 1 / (1 - |mean exp(i
    /// psi)|^2) times the variance of a mean.
    static double distinguished_from_tilt() {
        double psi_deg = 0, way = 1, cosine = 0, sine = 0;
        constexpr int kSteps = 6000;
        for (int i = 0; i < kSteps; ++i) {
            psi_deg += way * kSlew_deg_s * kRun_s / kSteps;
            if (std::abs(psi_deg) >= 88) way = psi_deg > 0 ? -1 : 1;
            cosine += std::cos(psi_deg * std::numbers::pi / 180) / kSteps;
            sine += std::sin(psi_deg * std::numbers::pi / 180) / kSteps;
        }
        return 1 / std::sqrt(1 - cosine * cosine - sine * sine);
    }

    Settings settings_;
    plant::Truth truth_;
};

TEST_P(ZerosAtARate, AreAsUncertainAsTheNoiseOfSoManySamples) {
    constexpr std::uint64_t kSeeds = 24;
    // z is the mean of what its accelerometer shows either way up, its scale is their difference;
    // likewise x and y.
    const double mean_mg = 1e3 * kNoise_g / std::sqrt(2 * kRun_s * GetParam());
    const std::array<double, 3> theory_mg{mean_mg * distinguished_from_tilt(),
                                          mean_mg * distinguished_from_tilt(), mean_mg};
    // The slews begin in the first of 60 updates. Tilts and gains of the level axes that are
    // estimated beside their zeros make these less sure than that, the more the less the noise.
    const std::array<double, 3> at_most{1.15, 1.15, 1.03};
    std::array<double, 3> squares{};
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        truth_.seed = seed + 1000 * static_cast<std::uint64_t>(GetParam());
        std::mt19937_64 generator(truth_.seed);
        std::uniform_real_distribution<double> within(-5e-3, 5e-3);
        for (double& zero : truth_.zero_g) zero = within(generator);
        ZeroCalibration zeroing(settings_.zero, settings_.rig, settings_.sample_s);
        RigAtRest rig(truth_);
        zeroing.begin();
        ASSERT_EQ(rig.zero_all(zeroing, nullptr), "");
        ASSERT_EQ(zeroing.finish(false), "");
        const ZeroStatus found = zeroing.status();
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_GT(found.sigma_mg[i], 0.99 * theory_mg[i]) << "xyz"[i];
            EXPECT_LT(found.sigma_mg[i], at_most[i] * theory_mg[i]) << "xyz"[i];
            squares[i] += std::pow((found.zero_mg[i] - 1e3 * truth_.zero_g[i]) / theory_mg[i], 2);
        }
    }
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_LT(squares[i], at_most[i] * at_most[i] * chi_square_999(kSeeds)) << "xyz"[i];
        EXPECT_GT(squares[i], chi_square_001(kSeeds)) << "xyz"[i];
    }
}

INSTANTIATE_TEST_SUITE_P(Hz, ZerosAtARate, testing::Values(40.0, 100.0, 1000.0),
                         [](const auto& of) { return std::to_string(static_cast<int>(of.param)); });

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
