// What a type's units tell of another one: by simulation of whole archives.
#include "estimator/uncertainty/population.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <stdexcept>

#include "estimator/uncertainty/distributions.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kSize = 30;

/// A type of units with an archive of them.
class Type {
  public:
    /// `common`: correlation of any two coefficients of a unit, in each group of ten.
    Type(std::uint64_t seed, double common) : random_(seed) {
        MatrixXd correlation = MatrixXd::Identity(kSize, kSize);
        for (Index i = 0; i < kSize; ++i)
            for (Index j = 0; j < kSize; ++j)
                if (i != j && i / 10 == j / 10) correlation(i, j) = common;
        VectorXd sigma(kSize), noise(kSize);
        for (Index i = 0; i < kSize; ++i) {
            mean(i) = i % 10 < 4 ? 1 : 0.03;
            sigma(i) = 0.1 * mean(i);
            noise(i) = 0.6 * sigma(i) * (1 + 0.5 * std::sin(static_cast<double>(i)));
        }
        between = sigma.asDiagonal() * correlation * sigma.asDiagonal();
        within = 0.04 * between.diagonal().asDiagonal().toDenseMatrix();
        // As of a campaign: bias and quadratic terms of a gyro are measured together.
        MatrixXd together = MatrixXd::Identity(kSize, kSize);
        for (Index g = 0; g < kSize; g += 10)
            for (Index j = g + 4; j < g + 7; ++j) together(g, j) = together(j, g) = -0.5;
        measured = noise.asDiagonal() * together * noise.asDiagonal();
        between_root_ = Eigen::LLT<MatrixXd>(between).matrixL();
        within_root_ = Eigen::LLT<MatrixXd>(within).matrixL();
        measured_root_ = Eigen::LLT<MatrixXd>(measured).matrixL();
    }

    VectorXd unit() { return mean + between_root_ * normal(); }
    VectorXd in_campaign(const VectorXd& unit) { return unit + within_root_ * normal(); }
    Found measure(const VectorXd& truth) { return {truth + measured_root_ * normal(), measured}; }
    Population archive(std::size_t units) {
        std::vector<std::vector<Found>> all(units);
        for (std::size_t i = 0; i < units; ++i) {
            const VectorXd one = unit();
            for (std::size_t k = 0; k < 1 + i % 3; ++k) all[i].push_back(measure(in_campaign(one)));
        }
        return population_of(all);
    }

    VectorXd mean = VectorXd::Zero(kSize);
    MatrixXd between, within, measured;

  private:
    VectorXd normal() {
        VectorXd out(kSize);
        for (double& x : out) x = normal_(random_);
        return out;
    }
    std::mt19937_64 random_;
    std::normal_distribution<double> normal_;
    MatrixXd between_root_, within_root_, measured_root_;
};

struct Honesty {
    double coverage = 0, with_coverage = 0, called_outside = 0, variance_ratio = 0;
};

/// `units` units of the type, a hundred for each archive of `known` others.
Honesty honesty_of(Type& type, std::size_t known, int units) {
    Honesty out;
    Population archive;
    const double all = static_cast<double>(units) * kSize;
    for (int n = 0; n < units; ++n) {
        if (n % 20 == 0) archive = type.archive(known);
        const VectorXd truth = type.in_campaign(type.unit());
        const Found alone = type.measure(truth);
        const bool outside = distance(archive, alone).outside();
        // As a campaign does it: what does not pass is not helped.
        const Found with = outside ? alone : with_type(archive, alone);
        out.called_outside += outside ? 1.0 / units : 0;
        for (Index i = 0; i < kSize; ++i) {
            const double u = std::sqrt(with.covariance(i, i));
            const double u_alone = std::sqrt(alone.covariance(i, i));
            out.with_coverage += std::abs(with.value(i) - truth(i)) < 1.96 * u ? 1 / all : 0;
            out.coverage += std::abs(alone.value(i) - truth(i)) < 1.96 * u_alone ? 1 / all : 0;
            out.variance_ratio += u * u / (u_alone * u_alone) / all;
        }
    }
    return out;
}

void expect_honest(std::uint64_t seed, int units) {
    for (const double common : {0.0, 0.6}) {
        for (const std::size_t known : {std::size_t{12}, std::size_t{30}, std::size_t{100}}) {
            Type type(seed, common);
            const Honesty found = honesty_of(type, known, units);
            std::printf(
                "%3zu known units, correlation %.1f: coverage %.4f, with the type %.4f, "
                "called outside %.4f, variance over that alone %.3f\n",
                known, common, found.coverage, found.with_coverage, found.called_outside,
                found.variance_ratio);
            SCOPED_TRACE(::testing::Message() << "seed " << seed << ", " << known
                                              << " known units, correlation " << common);
            EXPECT_NEAR(found.with_coverage, 0.95, 0.015);
            EXPECT_LT(found.called_outside, 2 * kOutsider + 4 * std::sqrt(0.01 / units));
            EXPECT_LT(found.variance_ratio, 0.9);
        }
    }
}

TEST(Population, TellsWhatItsUnitsAreAndHowTheyDiffer) {
    // GIVEN many units with a few campaigns each
    const std::uint64_t seed = 11;
    SCOPED_TRACE("seed " + std::to_string(seed));
    Type type(seed, 0.6);
    const Population found = type.archive(600);
    EXPECT_EQ(found.units, 600U);
    EXPECT_EQ(found.campaigns, 1200U);
    // THEN mean, scatter between units and between campaigns are what they were made of: of 600
    // units a variance is known to 6 %, four times that; the small one between campaigns is what is
    // left of a larger, to 0.06 of all that a campaign scatters by
    for (Index i = 0; i < kSize; ++i) {
        const double all = type.between(i, i) + type.within(i, i) + type.measured(i, i);
        EXPECT_NEAR(found.mean(i), type.mean(i), 4 * std::sqrt(all / 600)) << i;
        EXPECT_NEAR(found.between(i, i), type.between(i, i), 0.24 * all) << i;
        EXPECT_NEAR(found.within(i, i), type.within(i, i), 0.24 * all) << i;
        EXPECT_NEAR(found.predicted(i, i), type.between(i, i) + type.within(i, i), 0.3 * all) << i;
    }
    EXPECT_LT(found.independent, 0.3);
    EXPECT_NEAR(found.predicted(4, 7) / type.between(4, 7), 0.9, 0.3);
}

TEST(Population, OfAFewUnitsBelievesNoCorrelationsAndIsWider) {
    const std::uint64_t seed = 12;
    SCOPED_TRACE("seed " + std::to_string(seed));
    Type type(seed, 0.0);
    double wider = 0;
    for (int n = 0; n < 50; ++n) {
        const Population found = type.archive(12);
        EXPECT_GT(found.independent, 0.9);
        wider += found.predicted.diagonal().sum() / (type.between + type.within).trace() / 50;
    }
    // (13/12) 11/9 and the directions that are believed all the same
    EXPECT_GT(wider, 1.2);
    EXPECT_LT(wider, 2.5);
}

TEST(Population, IsNotMadeOfLessThanTenUnitsNorOfNoNumbers) {
    const Found good{VectorXd::Ones(kSize), MatrixXd::Identity(kSize, kSize)};
    std::vector<std::vector<Found>> units(kFewestUnits - 1, {good});
    EXPECT_THROW(static_cast<void>(population_of(units)), std::invalid_argument);
    units.push_back({good});
    // All the same: nothing scatters, and what was measured is all that is known
    const Population same = population_of(units);
    EXPECT_TRUE(same.predicted.allFinite());
    units[3][0].value(7) = std::nan("");
    EXPECT_THROW(static_cast<void>(population_of(units)), std::invalid_argument);
    units[3] = {};
    EXPECT_THROW(static_cast<void>(population_of(units)), std::invalid_argument);
}

TEST(Population, FindsAUnitThatIsNoneOfTheType) {
    const std::uint64_t seed = 13;
    SCOPED_TRACE("seed " + std::to_string(seed));
    Type type(seed, 0.0);
    const Population archive = type.archive(40);
    // GIVEN units that are of the type but for two coefficients of one gyro, ten of its scatters
    // away
    int found = 0;
    for (int n = 0; n < 100; ++n) {
        VectorXd truth = type.in_campaign(type.unit());
        truth(0) += 10 * std::sqrt(type.between(0, 0));
        truth(4) -= 10 * std::sqrt(type.between(4, 4));
        const Distance far = distance(archive, type.measure(truth));
        found += far.outside() ? 1 : 0;
        EXPECT_GT(far.squared, 30);
    }
    EXPECT_GE(found, 99);
    // AND of no numbers it says that it cannot tell
    Found broken = type.measure(type.mean);
    broken.value(0) = std::nan("");
    EXPECT_TRUE(distance(archive, broken).outside());
}

TEST(Population, WithItsTypeAUnitIsKnownBetter) {
    // GIVEN one coefficient known to 3 and a type of scatter 4: weights 16/25 and 9/25
    Population type;
    type.units = 1000;
    type.mean = VectorXd::Constant(1, 10);
    type.predicted = MatrixXd::Constant(1, 1, 16);
    const Found with = with_type(type, {VectorXd::Constant(1, 20), MatrixXd::Constant(1, 1, 9)});
    EXPECT_NEAR(with.value(0), 0.64 * 20 + 0.36 * 10, 1e-12);
    EXPECT_NEAR(with.covariance(0, 0), 9 * 16 / 25.0, 1e-12);
    const Distance d = distance(type, {VectorXd::Constant(1, 20), MatrixXd::Constant(1, 1, 9)});
    EXPECT_NEAR(d.squared, 4, 1e-12);
    EXPECT_NEAR(d.p, chi_square_tail(4, 1), 1e-3);
}

TEST(PopulationSeeds, CoverageOfTwoThousandUnitsStaysAndFewAreCalledOutsiders) {
    expect_honest(22, 2000);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
