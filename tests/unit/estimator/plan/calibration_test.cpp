#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimator/filter/linear_algebra.hpp"
#include "tests/unit/estimator/plan/calibration_readings.hpp"

namespace vibrig::estimator::plan {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(Calibration, SeedsShowErrorsAsLargeAsStated) {
    // GIVEN 100 tests on two spheres, the noise stated and not
    constexpr int kRuns = 100;
    for (const bool stated : {true, false}) {
        double squares = 0;
        int rejected = 0;
        for (unsigned run = 0; run < kRuns; ++run) {
            const SensorCalibration c = calibrate(readings({1, 2}, 2, 100 + run, stated));
            ASSERT_TRUE(c.test);
            rejected += c.test->probability < 0.05 ? 1 : 0;
            for (std::size_t k = 0; k < kTerms; ++k)
                squares += std::pow((c.value[k] - kTruth[k]) / c.sigma[k], 2) / (10.0 * kRuns);
        }
        // THEN z-rms is 1: 1000 numbers, 1 sigma 0.022; correlated ones at most three times that
        EXPECT_NEAR(std::sqrt(squares), 1, 0.1) << "seeds from 100, stated " << stated;
        // and the test of the residuals rejects one in twenty: binomial, 1 sigma 2.2
        EXPECT_NEAR(rejected, 5, 4 * 2.2) << "seeds from 100, stated " << stated;
    }
}

TEST(Calibration, SeedsShowThatAModelThatDoesNotHoldIsRejected) {
    // GIVEN a cubic term of 2 sigma at 1 g, 16 at 2 g, WHEN the ten terms are fitted
    for (unsigned run = 0; run < 20; ++run) {
        for (const bool stated : {true, false}) {
            const SensorCalibration c =
                calibrate(readings({1, 2}, 2, 300 + run, stated, 2 * kSigma));
            // THEN
            ASSERT_TRUE(c.test);
            EXPECT_LT(c.test->probability, 1e-3) << "seed " << 300 + run << ", stated " << stated;
        }
    }
}

TEST(Calibration, IsTheSameInAnyUnitOfTheInput) {
    const auto first = readings({0.5, 1}, 2, 11, true);
    const SensorCalibration c = calibrate(first);
    for (const double unit : {1e-9, 1e-3, 3600.0, 3.6e5, 1e9}) {
        auto scaled = first;
        for (Reading& r : scaled)
            for (double& x : r.input) x *= unit;
        const SensorCalibration found = calibrate(scaled);
        EXPECT_EQ(found.plan.rank, kTerms) << unit;
        EXPECT_NEAR(found.test->statistic, c.test->statistic, 1e-6 * c.test->statistic) << unit;
        for (std::size_t k = 0; k < kTerms; ++k) {
            const double by = std::pow(unit, k == 0 ? 0 : k < 4 ? 1 : 2);
            EXPECT_NEAR(found.value[k] * by, c.value[k], 1e-6 * c.sigma[k])
                << kTermNames[k] << unit;
            EXPECT_NEAR(found.sigma[k] * by, c.sigma[k], 1e-6 * c.sigma[k])
                << kTermNames[k] << unit;
        }
    }
}

TEST(Calibration, OneSphereLeavesTheBiasAndTheSquaresUndetermined) {
    const SensorCalibration c = calibrate(readings({1}, 2, 7, true));
    EXPECT_EQ(c.plan.rank, 9U);
    EXPECT_EQ(c.plan.undetermined(), "D0, D11, D22, D33");
    EXPECT_TRUE(std::isinf(c.sigma[0]));
    EXPECT_TRUE(std::isinf(c.sigma[4]));
    // What is determined is right all the same
    for (const std::size_t k : {1U, 2U, 3U, 7U, 8U, 9U})
        EXPECT_NEAR(c.value[k], kTruth[k], 4 * c.sigma[k]) << kTermNames[k];
    EXPECT_GT(c.test->probability, 1e-3);
}

TEST(Calibration, BadReadingsAreRefused) {
    const auto why = [](std::vector<Reading> list) -> std::string {
        try {
            static_cast<void>(calibrate(list));
        } catch (const PlanError& error) {
            return error.what();
        }
        return "";
    };
    std::vector<Reading> list = readings({1, 2}, 1, 1, true);
    EXPECT_NE(why({list.begin(), list.begin() + 9}).find("9 readings, expected 10"),
              std::string::npos);
    auto bad = list;
    bad[3].output = kNaN;
    EXPECT_NE(why(bad).find("reading 4"), std::string::npos);
    bad = list;
    bad[5].sigma = 0;
    EXPECT_NE(why(bad).find("reading 6: found sigma 0"), std::string::npos);
    bad[5].sigma = kNaN;
    EXPECT_NE(why(bad).find("reading 6"), std::string::npos);
    // What overflows when it is squared on the way is no better than what is not finite
    bad = list;
    bad[3].input[1] = 1e78;
    EXPECT_NE(why(bad).find("reading 4: input: found 1e+78, expected a number from -1e+12"),
              std::string::npos)
        << why(bad);
    bad = list;
    bad[3].output = -1e300;
    EXPECT_NE(why(bad).find("reading 4: output: found -1e+300"), std::string::npos) << why(bad);
    for (const double sigma : {1e-155, 1e300}) {
        bad = list;
        bad[5].sigma = sigma;
        EXPECT_NE(why(bad).find("reading 6: found sigma 1e"), std::string::npos) << why(bad);
    }
    // As many readings as coefficients: a solution, nothing to judge it by
    Terms line{};
    line[0] = line[1] = true;
    const SensorCalibration c = calibrate({{{-1, 0, 0}, -2, 0}, {{1, 0, 0}, 4, 0}}, line);
    EXPECT_NEAR(c.value[0], 1, 1e-12);
    EXPECT_NEAR(c.value[1], 3, 1e-12);
    EXPECT_TRUE(std::isnan(c.sigma[1]));
    EXPECT_FALSE(c.test);
}

TEST(Calibration, InputsThatExciteNoTermAreRefused) {
    Terms line{};
    line[1] = true;
    EXPECT_THROW(static_cast<void>(calibrate({{{0, 0, 0}, -2, 0}, {{0, 0, 0}, 4, 0}}, line)),
                 PlanError);
}

TEST(LinearAlgebra, WhatIsNotFiniteIsRefusedByPivotedColumns) {
    // Eigen reads out of bounds where the size of no column is a number
    using linear_algebra::Matrix;
    for (const double bad : {kNaN, std::numeric_limits<double>::infinity(), 1e200}) {
        Matrix a = Matrix::Identity(4, 3);
        a(2, 1) = bad;
        const Matrix b = Matrix::Ones(4, 1);
        EXPECT_THROW(static_cast<void>(linear_algebra::least_squares(a, b)), std::domain_error);
        EXPECT_THROW(static_cast<void>(linear_algebra::right_singular(a)), std::domain_error);
        EXPECT_THROW(static_cast<void>(linear_algebra::orthogonal_factor(a)), std::domain_error);
        EXPECT_THROW(static_cast<void>(linear_algebra::rank(a, 1e-9)), std::domain_error);
    }
    EXPECT_THROW(static_cast<void>(linear_algebra::least_squares(Matrix::Identity(4, 3),
                                                                 Matrix::Constant(4, 1, kNaN))),
                 std::domain_error);
    EXPECT_NEAR(linear_algebra::least_squares(Matrix::Identity(4, 3), Matrix::Ones(4, 1)).sum(), 3,
                1e-12);
}

}  // namespace
}  // namespace vibrig::estimator::plan
