#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

// The live filter's biases walk from dwell to dwell; the result's stand still.

namespace vibrig::estimator::testing {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using uncertainty::BiasModel;

constexpr double kEvery_s = 160;

/// Each position at 6 g, then, in another order, at rest: short dwells at some distance in time.
template <class BeforeDwell>
void campaign(Identification& to, RigSimulator& rig, double duration_s, BeforeDwell before) {
    SimulatedDwell plan;
    plan.duration_s = duration_s;
    for (int k = 0; k < 28; ++k) {
        const int position = k < 14 ? k : (5 * (k - 14) + 3) % 14;
        plan.info = {k < 14 ? 1 : 2, position + 1, -1, kEvery_s * k};
        plan.amplitude_g = k < 14 ? 6 : 0;
        plan.angles_deg = kTable1[static_cast<std::size_t>(position)];
        before(k);
        rig.dwell(to, plan);
    }
}

/// Generalised least squares on the rows: the biases at the last dwell, and what they were before
/// by a walk of q_deg2_h3 (deg/h)^2/h.
struct Reference {
    std::array<double, kParameters> value{}, sigma{};  ///< order of parameter_names()

    Reference(const std::vector<DwellRow>& rows, const ParameterArray& prior, double q_deg2_h3) {
        const auto n = static_cast<Index>(rows.size());
        MatrixXd h = MatrixXd::Zero(3 * n, kParameters), covariance = MatrixXd::Zero(3 * n, 3 * n);
        VectorXd y(3 * n);
        const auto before_h = [&](Index k) {
            const auto begin = [](const DwellRow& row) {
                return row.middle_s - row.duration_s / 2;
            };
            return (begin(rows.back()) - begin(rows[static_cast<std::size_t>(k)])) / 3600;
        };
        for (Index k = 0; k < n; ++k) {
            const DwellRow& row = rows[static_cast<std::size_t>(k)];
            y.segment<3>(3 * k) = mapped(row.rate);
            covariance.block<3, 3>(3 * k, 3 * k) = mapped(row.variance);
            for (Index j = 0; j < 3; ++j) {
                for (Index g = 0; g < 10; ++g)
                    h(3 * k + j, 3 * g + j) = mapped(row.regressors)(j, g);
            }
        }
        for (Index k = 0; k < n; ++k) {
            for (Index l = 0; l < n; ++l) {
                for (Index j = 0; j < 3; ++j)
                    covariance(3 * k + j, 3 * l + j) +=
                        q_deg2_h3 * std::min(before_h(k), before_h(l));
            }
        }
        const Eigen::LLT<MatrixXd> factor(covariance);
        MatrixXd information = h.transpose() * factor.solve(h);
        for (std::size_t i = 0; i < kParameters; ++i)
            information(static_cast<Index>(i), static_cast<Index>(i)) += 1 / (prior[i] * prior[i]);
        const MatrixXd p = Eigen::LLT<MatrixXd>(information)
                               .solve(MatrixXd::Identity(information.rows(), information.cols()));
        const VectorXd x = p * (h.transpose() * factor.solve(y));
        for (std::size_t i = 0; i < kParameters; ++i) {
            const auto a = static_cast<Index>(internal_of(i));
            value[i] = x[a];
            sigma[i] = std::sqrt(p(a, a));
        }
    }
};

TEST(WalkingBias, TheFilterIsLeastSquaresWithTheWalksKernel) {
    for (const double walk : {0.01, 0.1}) {
        SCOPED_TRACE("seed 71, walk " + std::to_string(walk));
        Settings settings;
        settings.drift.walk_deg_h_rt_h = walk;
        Identification identification(settings);
        RigSimulator rig(71);
        campaign(identification, rig, 20, [](int) {});
        Estimate estimate;
        identification.estimate(estimate);
        const Result result = identification.result();
        const Reference reference(result.rows, prior_sigma(settings), walk * walk);
        double largest = 0, widest = 0;
        for (std::size_t i = 0; i < kParameters; ++i) {
            largest = std::max(
                largest, std::abs(estimate.value[i] - reference.value[i]) / reference.sigma[i]);
            widest = std::max(widest, std::abs(estimate.sigma[i] / reference.sigma[i] - 1));
        }
        RecordProperty("largest_difference_sigma", std::to_string(largest));
        // A row loses what the encoders' noise and the turn within a dwell make of it.
        EXPECT_LT(largest, CrossCheck::kLimit);
        EXPECT_LT(widest, 0.01);
        // The same without rows: the sums of the batch.
        EXPECT_TRUE(result.cross_check.done);
        EXPECT_LT(result.cross_check.largest, CrossCheck::kLimit) << result.cross_check.coefficient;
    }
}

TEST(WalkingBias, SigmaIsThatOfTheBiasAsItIsNow) {
    // GIVEN rigs whose biases walk as the settings say
    constexpr double kWalk = 0.1;
    constexpr std::uint64_t kSeeds = 20;
    double now = 0, stood_still = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        Settings settings;
        settings.drift.walk_deg_h_rt_h = kWalk;
        Identification identification(settings);
        RigSimulator rig(seed);
        std::mt19937_64 random(seed);
        std::normal_distribution<double> gauss;
        campaign(identification, rig, 10, [&](int k) {
            for (std::size_t j = 0; j < 3 && k > 0; ++j)
                rig.truth[10 * j] += kWalk * std::sqrt(kEvery_s / 3600) * gauss(random);
        });
        // WHEN they are estimated by the filter and as if they stood still
        Estimate filter, constant;
        identification.estimate(filter);
        identification.solved(constant);
        for (std::size_t i = 0; i < kParameters; i += 10) {
            now += std::pow((filter.value[i] - rig.truth[i]) / filter.sigma[i], 2);
            stood_still += std::pow((constant.value[i] - rig.truth[i]) / constant.sigma[i], 2);
        }
    }
    // THEN the filter's errors are as large as it says: 99.9 % chi-square band of 60 errors
    const double count = 3 * kSeeds;
    const double a = 2 / (9 * count);
    const double most = std::pow(1 - a + 3.29 * std::sqrt(a), 3);
    EXPECT_LT(now / count, most) << "seeds 1 to 20";
    EXPECT_GT(now / count, std::pow(1 - a - 3.29 * std::sqrt(a), 3)) << "seeds 1 to 20";
    // AND the test tells the two apart
    EXPECT_GT(stood_still / count, most);
}

TEST(WalkingBias, StandsStillWhereTheSettingsSaySo) {
    Settings settings;
    settings.drift.model = BiasModel::constant;
    Identification identification(settings);
    RigSimulator rig(72);
    campaign(identification, rig, 10, [](int) {});
    Estimate filter, constant;
    identification.estimate(filter);
    identification.solved(constant);
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_LT(std::abs(filter.value[i] - constant.value[i]), 0.05 * constant.sigma[i])
            << parameter_names()[i] << ", seed 72";
        EXPECT_NEAR(filter.sigma[i] / constant.sigma[i], 1, 1e-3) << parameter_names()[i];
    }
}

TEST(WalkingBias, WithoutACommonClockAMinutePassesBetweenTheDwells) {
    // GIVEN the same readings with and without a clock, 60 s between the dwells
    const auto sigma_of = [](bool clock) {
        Settings settings;
        settings.drift.walk_deg_h_rt_h = 0.1;
        Identification identification(settings);
        RigSimulator rig(73);
        SimulatedDwell plan;
        plan.duration_s = 10;
        for (int k = 0; k < 6; ++k) {
            plan.info = {1, k + 1, -1};
            if (clock) plan.info.begin_s = (10 + kAssumedPause_s) * k;
            plan.angles_deg = kTable1[static_cast<std::size_t>(k)];
            rig.dwell(identification, plan);
        }
        Estimate estimate;
        identification.estimate(estimate);
        return estimate.sigma;
    };
    const auto with = sigma_of(true), without = sigma_of(false);
    // THEN it makes one sample period of difference
    for (std::size_t i = 0; i < kParameters; ++i)
        EXPECT_NEAR(without[i] / with[i], 1, 1e-3) << parameter_names()[i];
}

}  // namespace
}  // namespace vibrig::estimator::testing
