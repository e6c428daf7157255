#include "estimator/spectrum/resonance.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>

#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using namespace testing;

/// The survey with a deterministic error of gyro x.
struct GoldenSurvey : ::testing::Test {
    GoldenSurvey() {
        Dwells dwells = dwells_of({}, Truth::common(0.5, kSixty), survey());
        for (std::size_t i = 0; i < dwells.list.size(); ++i)
            dwells.list[i].row.rate[0] += 0.007 * std::sin(static_cast<double>(i) + 1);
        table.emplace(Settings{}, dwells.list, dwells.kinds);
        problem.rate.resize(63);
        for (Index k = 0; k < 63; ++k)
            problem.rate[k] = dwells.list[static_cast<std::size_t>(k)].row.rate[0];
        problem.covariance = 4.891201e-5 * MatrixXd::Identity(63, 63);
        problem.prior_sigma.resize(10);
        problem.prior_sigma << 10, 10, 10, 10, 1, 1, 1, 1, 1, 1;
    }
    std::optional<SpectralTable> table;
    GyroProblem problem;
};

TEST_F(GoldenSurvey, CoefficientsAtTheTrueResonance) {
    ASSERT_EQ(table->dwells(), 63);
    const MatrixXd g = gain(*table, 0, problem, {1, {kSixty}, {}, {}});
    const VectorXd x = g * problem.rate;
    const std::array<double, 16> golden{0.999913340, -1.001410420, 1.001236430, -0.996969629,
                                        0.030020452, -0.030050154, 0.029975146, -0.030089251,
                                        0.029932939, -0.030143279, 0.015043643, -0.014997036,
                                        0.015003411, -0.014943471, 0.015198178, -0.015175545};
    for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(x[static_cast<Index>(i)], golden[i], 1e-7);
    const VectorXd left = problem.rate - design(*table, 0, {kSixty}) * x;
    EXPECT_NEAR(left.squaredNorm() / 4.891201e-5, 21.053960, 1e-3);
    const std::array<double, 6> u{6.5824e-5,  8.6311e-5,  6.6127e-5,
                                  1.03915e-4, 1.77117e-4, 1.03915e-4};
    // Independent rates of one variance: u of a gain is the root of its square.
    for (std::size_t q = 0; q < 6; ++q)
        EXPECT_NEAR(std::sqrt(4.891201e-5) * g.row(10 + static_cast<Index>(q)).norm(), u[q], 1e-8);
}

TEST_F(GoldenSurvey, MixtureFindsTheResonance) {
    const Mixture found = one_resonance(*table, 0, problem);
    ASSERT_TRUE(found.resonant());
    const ResonanceEstimate fitted = estimates(found).at(0);
    EXPECT_NEAR(fitted.hz.mean, 59.993, 0.02);
    EXPECT_NEAR(fitted.hz.sigma, 0.152, 0.02);
    EXPECT_NEAR(fitted.damping.mean, 0.0502, 0.0003);
    EXPECT_NEAR(fitted.damping.sigma, 0.0016, 0.0003);
    // Well determined, so normal: 95 % lie within 1.96 sigma.
    EXPECT_NEAR(fitted.hz.low, 59.993 - 1.96 * 0.152, 0.02);
    EXPECT_NEAR(fitted.hz.high, 59.993 + 1.96 * 0.152, 0.02);
    EXPECT_NEAR(fitted.damping.low, 0.0502 - 1.96 * 0.0016, 0.0005);
    EXPECT_NEAR(fitted.damping.high, 0.0502 + 1.96 * 0.0016, 0.0005);
    EXPECT_GT(found.log_odds, 600);
    EXPECT_LE(found.list.size(), 300U);
    EXPECT_EQ(found.degrees, 45);

    const Hypothesis flat = without_resonance(*table, 0, problem);
    const VectorXd left = problem.rate - design(*table, 0, {}) * flat.x;
    EXPECT_NEAR(left.squaredNorm() / 4.891201e-5, 139186.926, 1e-2);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
