#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/crlb.hpp"
#include "estimator/identification.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr double kTwoThirds = 14.0 / 3.0;  ///< g at the platform for 7 g at the table

std::array<double, kParameters> bound(double first_g, double second_g) {
    std::vector<PlannedDwell> plan;
    for (double a : {first_g, second_g}) {
        for (const auto& position : kTable1) plan.push_back({position, 1 + a * a / 2, 100});
    }
    return predicted_sigma(Settings{}, plan, kTable2);
}

/// Normalised squared error of the estimate in its own covariance, 30 degrees of freedom.
double nees(const Result& result) {
    Eigen::Matrix<double, kParameters, 1> error;
    Eigen::Matrix<double, kParameters, kParameters> correlation;
    for (Eigen::Index i = 0; i < error.size(); ++i) {
        const auto k = static_cast<std::size_t>(i);
        error[i] = (result.value[k] - kTable2[k]) / result.sigma[k];
        for (Eigen::Index j = 0; j < error.size(); ++j) {
            correlation(i, j) = result.covariance(i, j) /
                                (result.sigma[k] * result.sigma[static_cast<std::size_t>(j)]);
        }
    }
    return error.dot(correlation.ldlt().solve(error));
}

/// Every determined combination agrees with the truth.
void expect_true_combinations(const Result& result) {
    for (const Combination& c : result.combinations) {
        double truth = 0, prior = 0, largest = 0;
        std::string text;
        for (const auto& [name, weight] : c.weights) {
            for (std::size_t i = 0; i < kParameters; ++i) {
                if (name == parameter_names()[i]) truth += weight * kTable2[i];
            }
            const double sigma = name.size() == 4 ? 10 : 1;  // D_Fx, D_Ix; D_IIx
            prior += weight * weight * sigma * sigma;
            largest = std::max(largest, std::abs(weight));
            text += name + " * " + std::to_string(weight) + "  ";
        }
        EXPECT_LT(std::abs(c.value - truth), 4.5 * c.sigma) << text;
        EXPECT_GT(c.sigma, 0) << text;
        EXPECT_LT(c.sigma, 0.5 * std::sqrt(prior)) << text;
        EXPECT_LT(largest, 3 * 19) << text;
    }
}

TEST(Campaign, TwoLevelsReachTheCramerRaoBoundAndClaimNoMore) {
    // GIVEN the 14 positions at 6 and 4.667 g on the platform, 12 times
    constexpr int kRuns = 12;
    const std::uint64_t first_seed = 100;
    SCOPED_TRACE("seeds from " + std::to_string(first_seed));
    const std::array<double, kParameters> crlb = bound(6, kTwoThirds);
    double total_nees = 0, ratio_square = 0;
    for (int run = 0; run < kRuns; ++run) {
        Identification identification{Settings{}};
        RigSimulator rig(first_seed + static_cast<std::uint64_t>(run));
        rig.campaign(identification, {6.0, kTwoThirds});
        const Result result = identification.result();
        EXPECT_TRUE(result.combinations.empty());
        EXPECT_TRUE(result.warnings.empty()) << result.warnings.front();
        for (std::size_t i = 0; i < kParameters; ++i) {
            EXPECT_TRUE(result.observable[i]) << parameter_names()[i];
            // THEN each sigma is the bound's
            EXPECT_NEAR(result.sigma[i] / crlb[i], 1, 0.01) << parameter_names()[i];
            const double ratio = (result.value[i] - kTable2[i]) / crlb[i];
            EXPECT_LT(std::abs(ratio), 4.5) << parameter_names()[i] << " seed offset " << run;
            ratio_square += ratio * ratio;
        }
        const double samples = 28 * 4000;
        EXPECT_NEAR(result.nis_per_dof, 1, 3.29 * std::sqrt(2 / (3 * samples)));
        total_nees += nees(result);
    }
    // AND the mean NEES is within its 95 % band, the rms error within what correlated coefficients
    // allow
    const double mean_nees = total_nees / kRuns;
    EXPECT_NEAR(mean_nees, 30, 1.96 * std::sqrt(60.0 / kRuns));
    EXPECT_NEAR(std::sqrt(ratio_square / (30 * kRuns)), 1, 0.2);
    RecordProperty("nees", std::to_string(mean_nees));
    RecordProperty("rms_over_crlb", std::to_string(std::sqrt(ratio_square / (30 * kRuns))));
}

TEST(Campaign, AStaticRunIsTheBetterPartner) {
    Identification identification{Settings{}};
    RigSimulator rig(120);
    rig.campaign(identification, {6.0, 0.0});
    const Result result = identification.result();
    const std::array<double, kParameters> crlb = bound(6, 0);
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_NEAR(result.sigma[i] / crlb[i], 1, 0.01) << parameter_names()[i];
        EXPECT_LT(std::abs(result.value[i] - kTable2[i]), 4.5 * result.sigma[i])
            << parameter_names()[i];
    }
    ASSERT_EQ(result.amplitudes.size(), 2U);
    EXPECT_NEAR(result.amplitudes[0].amplitude_g, 6, 1e-3);
    EXPECT_NEAR(result.amplitudes[0].frequency_hz, 15, 1e-4);
    EXPECT_EQ(result.amplitudes[1].kappa, 1.0);
    EXPECT_EQ(result.amplitudes[1].frequency_hz, 0.0);
}

TEST(Campaign, SpikesAreGatedAndDoNoHarm) {
    Identification identification{Settings{}};
    RigSimulator rig(121);
    SimulatedDwell plan;
    plan.spike_probability = 1e-3;
    plan.lost_probability = 1e-3;
    plan.second_harmonic = 0.05;
    rig.campaign(identification, {6.0, kTwoThirds}, plan);
    const Result result = identification.result();
    EXPECT_GT(result.rejected, 200U);
    EXPECT_LT(result.rejected, 500U);
    EXPECT_LT(nees(result), 60);  // p = 1e-3
}

TEST(Campaign, OneLevelNamesWhatItCannotTellApart) {
    for (double amplitude : {6.0, 0.0}) {
        // GIVEN both runs at the same level
        Identification identification{Settings{}};
        RigSimulator rig(122);
        rig.campaign(identification, {amplitude, amplitude});
        const Result result = identification.result();
        // THEN bias and squares of every gyro are null, the rest is as good as ever
        for (std::size_t i = 0; i < kParameters; ++i) {
            const std::size_t place = i % 10;
            const bool apart = !(place == 0 || (place >= 4 && place <= 6));
            EXPECT_EQ(result.observable[i], apart) << parameter_names()[i];
            EXPECT_EQ(std::isfinite(result.value[i]), apart);
            EXPECT_EQ(std::isfinite(result.covariance(static_cast<Eigen::Index>(i),
                                                      static_cast<Eigen::Index>(i))),
                      apart);
            if (apart) {
                EXPECT_LT(std::abs(result.value[i] - kTable2[i]), 4.5 * result.sigma[i])
                    << parameter_names()[i];
            }
        }
        // AND three combinations per gyro are given instead: D_F + kappa D_OO, D_II - D_OO, D_SS -
        // D_OO
        ASSERT_EQ(result.combinations.size(), 9U);
        const Combination& first = result.combinations.front();
        ASSERT_EQ(first.weights.size(), 2U);
        EXPECT_EQ(first.weights[0].first, "D_Fx");
        EXPECT_EQ(first.weights[1].first, "D_OOx");
        EXPECT_NEAR(first.weights[1].second, 1 + amplitude * amplitude / 2, 0.01);
        EXPECT_EQ(result.combinations[1].weights[0].first, "D_IIx");
        EXPECT_EQ(result.combinations[1].weights[1].second, -1.0);
        expect_true_combinations(result);
        EXPECT_FALSE(result.warnings.empty());
    }
}

TEST(Campaign, TooFewPositionsLeaveNamedCombinations) {
    // GIVEN two levels at the position (0, 0, 0) alone: the vertical lies along y all the time
    Identification identification{Settings{}};
    RigSimulator rig(123);
    SimulatedDwell plan;
    for (int run : {1, 2}) {
        plan.info.run = run;
        plan.amplitude_g = run == 1 ? 6 : 0;
        rig.dwell(identification, plan);
    }
    const Result result = identification.result();
    // THEN of gyro x, whose output axis is y, only the square along it is told apart from the rest
    std::size_t observable = 0;
    for (bool o : result.observable) observable += o ? 1 : 0;
    EXPECT_EQ(observable, 3U);
    EXPECT_TRUE(result.observable[5]) << "D_OOx";
    EXPECT_TRUE(result.observable[14]) << "D_IIy";
    EXPECT_TRUE(result.observable[26]) << "D_SSz";
    expect_true_combinations(result);
    // AND the other thing known of it is the sum of bias and linear term along y
    const auto sum =
        std::find_if(result.combinations.begin(), result.combinations.end(),
                     [](const Combination& c) { return c.weights[0].first == "D_Fx"; });
    ASSERT_NE(sum, result.combinations.end());
    for (const auto& [name, weight] : sum->weights) {
        EXPECT_NEAR(weight, name == "D_Fx" || name == "D_Ox" ? 1 : 0, 0.05) << name;
    }
    EXPECT_LT(sum->sigma, 0.05);
}

TEST(Campaign, NothingIsObservableBeforeThereAreData) {
    const Identification identification{Settings{}};
    const Result result = identification.result();
    for (bool o : result.observable) EXPECT_FALSE(o);
    EXPECT_TRUE(result.combinations.empty());
    Estimate estimate;
    identification.estimate(estimate);
    EXPECT_EQ(estimate.sigma[0], 10.0);
    EXPECT_EQ(estimate.sigma[1], 10.0);
    EXPECT_EQ(estimate.sigma[5], 1.0);
}

TEST(Campaign, TwoStepRouteRecoversAllThirty) {
    Settings settings;
    settings.method = Method::two_step;
    // GIVEN the paper's two runs, the smaller level first, told the commanded levels
    Identification identification(settings);
    RigSimulator rig(124);
    SimulatedDwell plan;
    for (int run : {1, 2}) {
        for (std::size_t p = 0; p < kTable1.size(); ++p) {
            plan.info = {run, static_cast<int>(p) + 1, run == 1 ? 7.0 : 9.0};
            plan.angles_deg = kTable1[p];
            plan.amplitude_g = run == 1 ? kTwoThirds : 6.0;
            rig.dwell(identification, plan);
        }
    }
    const Result result = identification.result();
    // THEN all are given; eq. 13's start-up makes their errors up to 2.7 times what is claimed
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_TRUE(result.observable[i]) << parameter_names()[i];
        EXPECT_LT(std::abs(result.value[i] - kTable2[i]), 4 * 2.7 * result.sigma[i])
            << parameter_names()[i];
    }
    EXPECT_NEAR(result.amplitudes[1].kappa, 19, 1e-3);
}

TEST(Campaign, TwoStepRouteRefusesOtherThanTwoRuns) {
    Settings settings;
    settings.method = Method::two_step;
    SimulatedDwell plan;
    plan.duration_s = 5;
    for (int runs : {1, 3}) {
        Identification identification(settings);
        RigSimulator rig(125);
        for (int run = 1; run <= runs; ++run) {
            plan.info.run = run;
            plan.amplitude_g = 2.0 * run;
            rig.dwell(identification, plan);
        }
        const Result result = identification.result();
        for (bool o : result.observable) EXPECT_FALSE(o);
        ASSERT_FALSE(result.warnings.empty());
        EXPECT_TRUE(result.combinations.empty());
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
