#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

// Many simulated campaigns (9 and 7 g at the table, Table 1 of Tang et al. 2009): are the errors as
// large as the filter says, and as small as information theory allows?

namespace vibrig::estimator::testing {
namespace {

constexpr std::array<double, 2> kLevels{6.0, 14.0 / 3.0};
constexpr std::uint64_t kFirstSeed = 1000;

/// Quantile of chi-square over its degrees of freedom (Wilson and Hilferty); z is the normal one.
double chi_square_quantile(double degrees, double z) {
    const double a = 2.0 / (9.0 * degrees);
    return std::pow(1.0 - a + z * std::sqrt(a), 3);
}

struct Statistics {
    double seeds = 0, nees = 0, nis = 0, samples = 0, largest_sigma_error = 0;
    std::array<double, kParameters> mean_square{};  ///< of error / Cramer-Rao bound
    std::array<double, kParameters> covered{};      ///< share of 95 % intervals that hold the truth

    [[nodiscard]] double rms() const {
        double sum = 0;
        for (const double m : mean_square) sum += m / static_cast<double>(kParameters);
        return std::sqrt(sum);
    }
};

Statistics run(std::uint64_t seeds, double duration_s, std::size_t gyro_average = 1,
               double period_s = SimulatedDwell{}.period_s) {
    Statistics s;
    std::vector<PlannedDwell> plan;
    for (const double a0 : kLevels) {
        for (const auto& p : kTable1) plan.push_back({p, 1 + a0 * a0 / 2, duration_s});
    }
    const std::array<double, kParameters> bound = predicted_sigma({}, plan, kTable2, period_s);
    const auto n = static_cast<double>(seeds);
    for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + seeds; ++seed) {
        Identification identification{Settings{}};
        RigSimulator rig(seed);
        rig.gyro_average = gyro_average;
        SimulatedDwell dwell;
        dwell.duration_s = duration_s;
        dwell.period_s = period_s;
        rig.campaign(identification, kLevels, dwell);
        const Result result = identification.result();
        Eigen::Matrix<double, kParameters, 1> sigma, error;
        for (std::size_t i = 0; i < kParameters; ++i) {
            EXPECT_TRUE(result.observable[i]) << parameter_names()[i] << ", seed " << seed;
            const auto k = static_cast<Eigen::Index>(i);
            sigma[k] = result.sigma[i];
            error[k] = (result.value[i] - kTable2[i]) / result.sigma[i];
            s.mean_square[i] += std::pow((result.value[i] - kTable2[i]) / bound[i], 2) / n;
            s.covered[i] += std::abs(error[k]) <= 1.959964 ? 1 / n : 0;
            s.largest_sigma_error =
                std::max(s.largest_sigma_error, std::abs(result.sigma[i] / bound[i] - 1));
        }
        const Covariance correlation = sigma.cwiseInverse().asDiagonal() *
                                       mapped(result.covariance) *
                                       sigma.cwiseInverse().asDiagonal();
        s.nees += error.dot(linear_algebra::covariance_inverse(correlation) * error) / n;
        s.nis += result.nis_per_dof / n;
        s.samples += static_cast<double>(result.samples - result.rejected);
    }
    s.seeds = n;
    return s;
}

/// Bands of NEES and NIS at `z` normal standard deviations, and sigma within 1 % of the bound.
void expect_consistent(const Statistics& s, double z) {
    const double degrees = 30 * s.seeds;
    EXPECT_GT(s.nees / 30, chi_square_quantile(degrees, -z));
    EXPECT_LT(s.nees / 30, chi_square_quantile(degrees, z));
    EXPECT_NEAR(s.nis, 1, z * std::sqrt(2 / (3 * s.samples)));
    EXPECT_LT(s.largest_sigma_error, 0.01);
}

TEST(Statistics, AHundredCampaignsReachTheCramerRaoBound) {
    SCOPED_TRACE("seeds from " + std::to_string(kFirstSeed));
    // GIVEN 100 rigs that differ by their noise only
    const Statistics s = run(100, 100);
    RecordProperty("rms_over_bound", std::to_string(s.rms()));
    RecordProperty("nees", std::to_string(s.nees));
    RecordProperty("nis", std::to_string(s.nis));
    // THEN the errors are the least that any unbiased estimator has, and as large as the filter
    // says
    EXPECT_LE(s.rms(), 1.05);
    expect_consistent(s, 1.96);
    for (std::size_t i = 0; i < kParameters; ++i) {
        // 99.9 % chi-square band of each
        EXPECT_LT(s.mean_square[i], chi_square_quantile(s.seeds, 3.29)) << parameter_names()[i];
        EXPECT_GT(s.mean_square[i], chi_square_quantile(s.seeds, -3.29)) << parameter_names()[i];
    }
}

TEST(Statistics, ErrorsAndSigmaAreRightAtAnySampleRate) {
    SCOPED_TRACE("seeds from " + std::to_string(kFirstSeed));
    for (const double period_s : {0.01, 0.001}) {
        SCOPED_TRACE("sample period " + std::to_string(period_s) + " s");
        // GIVEN samples at 100 Hz and at 1 kHz, each with the noise that the settings state
        const bool fast = period_s < 0.005;
        const Statistics s = run(fast ? 2 : 20, fast ? 3 : 5, 1, period_s);
        // THEN the result's sigma is that of the plan at this rate, and the errors are as large
        expect_consistent(s, 3.29);
        EXPECT_LT(s.rms() * s.rms(), chi_square_quantile(30 * s.seeds, 3.29));
    }
}

TEST(Statistics, GyroNoiseAveragedOverEightSamplesIsHarmless) {
    SCOPED_TRACE("seeds from " + std::to_string(kFirstSeed));
    // GIVEN gyro noise with the autocorrelation of a running mean (Tang et al. 2009, eq. 9), R(tau)
    // = sigma^2 (T - |tau|) / T^2 with T = 0.2 s, where the filter takes it for white
    const Statistics s = run(16, 25, 8);
    // THEN the errors are still those the filter says, inside the 99.9 % band: what counts is the
    // walk over the dwell, which the averaging changes by T / (3 * 25 s)
    const double degrees = 30 * s.seeds;
    EXPECT_GT(s.nees / 30, chi_square_quantile(degrees, -3.29));
    EXPECT_LT(s.nees / 30, chi_square_quantile(degrees, 3.29));
}

TEST(StatisticsSoak, FiveHundredCampaignsAreCoveredByTheirIntervals) {
    SCOPED_TRACE("seeds from " + std::to_string(kFirstSeed));
    const Statistics s = run(500, 100);
    double all = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        all += s.covered[i] / static_cast<double>(kParameters);
        EXPECT_GE(s.covered[i], 0.91) << parameter_names()[i];
        EXPECT_LE(s.covered[i], 0.985) << parameter_names()[i];
    }
    RecordProperty("covered", std::to_string(all));
    EXPECT_GE(all, 0.93);
    EXPECT_LE(all, 0.97);
}

}  // namespace
}  // namespace vibrig::estimator::testing
