#include <gtest/gtest.h>

#include <cmath>

#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/fit.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using estimator::testing::kTable2;

/// The 28 dwells of 9 and 7 g in balanced order; gyro x with a step of 0.03 deg/h half way and a
/// known scatter, y and z without error.
struct Golden : ::testing::Test {
    Golden() {
        for (std::size_t i = 0; i < rows.size(); ++i)
            rows[i].rate[0] +=
                0.03 * ((i >= 14 ? 1 : 0) - 0.5) + 0.007 * std::sin(static_cast<double>(i) + 1);
        table = dwell_table(rows);
        for (std::size_t j = 0; j < 3; ++j) {
            GyroRates& gyro = gyros[j];
            gyro.time_h = table.time_h;
            gyro.rate.resize(28);
            gyro.variance = VectorXd::Constant(28, estimator::testing::kRateVariance);
            gyro.regressors.resize(28, 10);
            gyro.prior_information = VectorXd::Zero(10);
            for (Index k = 0; k < 28; ++k) {
                gyro.rate[k] = rows[static_cast<std::size_t>(k)].rate[j];
                gyro.regressors.row(k) = mapped(rows[static_cast<std::size_t>(k)].regressors[j]);
            }
        }
        for (std::size_t i = 0; i < kParameters; ++i) truth[internal_of(i)] = kTable2[i];
    }
    Settings settings;
    std::vector<DwellRow> rows =
        estimator::testing::theory_rows(settings, estimator::testing::balanced(6, 14.0 / 3));
    DwellTable table;
    std::array<GyroRates, 3> gyros;
    ParameterArray truth{};
};

TEST_F(Golden, CoefficientsAveragedOverWhatTheBiasMayHaveDone) {
    const DriftAverage x = average_drift(gyros[0], {});
    const std::array<double, 10> value{0.998034960, -0.996291486, 0.999073778, -0.998755712,
                                       0.030312460, -0.029705849, 0.030035466, -0.030215453,
                                       0.030229967, -0.030435685};
    const std::array<double, 10> u_a{0.006220955, 0.006278360, 0.002554037, 0.003007621,
                                     0.000589308, 0.000416786, 0.000455474, 0.000503806,
                                     0.000799740, 0.000505476};
    for (Index i = 0; i < 10; ++i) {
        const auto k = static_cast<std::size_t>(i);
        EXPECT_NEAR(x.value[i], value[k], 2e-7) << i;
        EXPECT_NEAR(std::sqrt(x.covariance(i, i)), u_a[k], 2e-7) << i;
    }
    // The gain is the estimator itself.
    EXPECT_LT((x.gain * gyros[0].rate - x.value).norm(), 1e-9);
}

TEST_F(Golden, WeightsOfTheHypotheses) {
    const DriftAverage x = average_drift(gyros[0], {});
    const auto weight = [&](const auto& is) {
        double sum = 0;
        for (const auto& [what, w] : x.likeliest) sum += is(what) ? w : 0;
        return sum;
    };
    using H = DriftHypothesis;
    const auto slow = [](const H& h, double b, double c) {
        return h.step_after == 0 && h.unbalance == H::Unbalance::none && h.scatter == 0 &&
               h.walk == b && h.trend == c;
    };
    const auto step = [](const H& h, int k) {
        return h.step_after == k && h.unbalance == H::Unbalance::none && h.walk == 0;
    };
    EXPECT_NEAR(weight([&](const H& h) { return step(h, 14); }), 0.633477, 5e-6);
    EXPECT_NEAR(weight([&](const H& h) { return step(h, 13); }), 0.159903, 5e-6);
    EXPECT_NEAR(weight([&](const H& h) { return slow(h, 4, 0); }), 0.068824, 5e-6);
    EXPECT_NEAR(weight([&](const H& h) { return slow(h, 4, 4); }), 0.033894, 5e-6);
    EXPECT_NEAR(x.weights.none / 1.9e-21, 1, 0.05);
    EXPECT_EQ(x.step.after_dwell, 14);
    EXPECT_NEAR(x.step.size, 0.03, 2 * x.step.sigma);
}

TEST_F(Golden, LackOfFitAndEvidence) {
    // 121.12379 holds the prior's share, sum (D / sigma)^2 = 0.1361.
    const NullFit fit(table, MatrixXd(84, 0), VectorXd::Zero(30));
    EXPECT_NEAR(fit.chi_square(), 121.12379 - 0.13615, 2e-4);
    EXPECT_EQ(fit.degrees(), 54);
    // With the prior: no more than that either, but for what it leaves the coefficients off.
    VectorXd prior(30);
    for (Index i = 0; i < 30; ++i) prior[i] = i < 12 ? 0.01 : 1;
    EXPECT_NEAR(NullFit(table, MatrixXd(84, 0), prior).chi_square(), fit.chi_square(), 2e-4);
    RampFit ramps = fit_ramps(table, fit.value());
    for (double& mean : ramps.mean) mean = 0;
    const auto evidence = weigh_patterns(table, fit, ramps, ForwardModel(settings, truth), gyros);
    const auto odds = [&](Pattern pattern) {
        for (const Evidence& e : evidence) {
            if (e.pattern == pattern) return e.log_odds;
        }
        return -1.0;
    };
    EXPECT_NEAR(odds(Pattern::step), 43.978, 2e-3);
    // Walk and scatter by the definition: the mean over the sizes is taken once for each gyro. What
    // comes of taking it twice: OddsOfScatterAndWalkAgainFromTheDefinition.
    EXPECT_NEAR(odds(Pattern::walk), 42.5315, 1e-3);
    EXPECT_NEAR(odds(Pattern::trend), 38.160, 2e-3);
    EXPECT_NEAR(odds(Pattern::scatter), 29.6628, 1e-3);
    EXPECT_EQ(evidence.front().pattern, Pattern::step);
    EXPECT_EQ(evidence.front().after_dwell, 14);
    EXPECT_NEAR(evidence.front().size[0], 0.03, 2 * evidence.front().sigma[0]);
}

/// log of the mean of two, each worked out term by term from the likelihood ratios; `divisor`: by
/// what the sums over five sizes are divided.
double odds_again(const std::array<GyroRates, 3>& gyros, const std::array<double, 5>& sizes,
                  bool walk, double divisor) {
    double together = 0, apart = 1;
    std::array<double, 5> product;
    product.fill(1);
    for (const GyroRates& gyro : gyros) {
        const DriftLikelihood of(gyro);
        double sum = 0;
        for (std::size_t i = 0; i < sizes.size(); ++i) {
            const double ratio =
                std::exp(walk ? of.ratio_of_walk(sizes[i]) : of.ratio_of_scatter(sizes[i]));
            product[i] *= ratio;
            sum += ratio;
        }
        apart *= 0.5 + 0.5 * sum / divisor;
    }
    for (const double one : product) together += one / divisor;
    return std::log(0.5 * together + 0.5 * apart);
}

TEST_F(Golden, OddsOfScatterAndWalkAgainFromTheDefinition) {
    constexpr std::array<double, 5> kScatter{0.5, 1, 2, 4, 8}, kWalk{2, 4, 8, 16, 32};
    EXPECT_NEAR(odds_again(gyros, kWalk, true, 5), 42.5315, 1e-3);
    EXPECT_NEAR(odds_again(gyros, kScatter, false, 5), 29.6628, 1e-3);
    // Five times too small: the mean over the five sizes taken twice.
    EXPECT_NEAR(odds_again(gyros, kWalk, true, 25), 40.908, 2e-3);
    EXPECT_NEAR(odds_again(gyros, kScatter, false, 25), 28.010, 2e-3);
}

TEST_F(Golden, SignaturesOfTheFirstDwell) {
    const ForwardModel model(settings, truth);
    const auto of = [&](Misfit misfit, Index unknown, double sizes) {
        const Signatures s = signatures(misfit, table, model, 0.007);
        return Eigen::Vector3d(s.z.col(unknown).head<3>() * sizes / s.size);
    };
    const auto near = [](const Eigen::Vector3d& z, double x, double y, double zz) {
        EXPECT_LT((z - Eigen::Vector3d(x, y, zz)).cwiseAbs().maxCoeff(), 2e-9) << z.transpose();
    };
    near(of(Misfit::azimuth, 0, 1), 8.394e-6, -3.053002e-3, 6.709e-6);
    near(of(Misfit::latitude, 0, 1), 3.133562e-3, 1.5326e-5, 3.053447e-3);
    near(of(Misfit::cross_axis, 0, 0.01), 5.405939e-3, -5.393863e-3, -5.373123e-3);
    near(of(Misfit::cross_axis, 1, 0.01), -5.338426e-3, -5.415576e-3, -5.461420e-3);
}

/// What the named columns do together to a constant-bias estimate: the largest shift in sigma, and
/// the chi-square by which it shows.
struct Shown {
    double shift = 0, chi_square = 0;
};

Shown shown(const NullFit& fit, const Signatures& of, const std::vector<Index>& columns,
            double size) {
    VectorXd z = VectorXd::Zero(of.z.rows());
    for (const Index i : columns) z += of.z.col(i) * (size / of.size);
    const VectorXd sigma = fit.covariance().diagonal().cwiseSqrt();
    return {fit.change(z).cwiseQuotient(sigma).cwiseAbs().maxCoeff(), fit.project(z).f(0, 0)};
}

// The figures of docs/theory/uncertainty.md, "What can be named".
TEST_F(Golden, WhatMisfitsShiftAndHowTheyShow) {
    const NullFit fit(table, MatrixXd(84, 0), VectorXd::Zero(30));
    const ForwardModel model(settings, truth);
    const auto expect = [&](const Signatures& of, const std::vector<Index>& columns, double size,
                            const Shown& is) {
        const Shown found = shown(fit, of, columns, size);
        EXPECT_NEAR(found.shift, is.shift, 0.01) << of.unit;
        EXPECT_NEAR(found.chi_square, is.chi_square, 0.05) << of.unit;
    };
    const Signatures cubic = signatures(Misfit::cubic, table, model, 0.007);
    expect(cubic, {0}, 1e-3, {3.98, 9.39});
    expect(cubic, {0, 3, 6}, 1e-3, {17.69, 61.18});
    expect(signatures(Misfit::step, table, model, 0.007, 14), {0, 1, 2}, 0.01, {0.88, 37.58});
    const Signatures unbalance = signatures(Misfit::unbalance_step, table, model, 0.007, 14);
    expect(unbalance, {0, 3, 6}, 0.01, {0.50, 12.83});
    expect(unbalance, {0, 1, 2, 3, 4, 5, 6, 7, 8}, 0.01, {0.72, 33.86});
    expect(signatures(Misfit::time_base, table, model, 0.007), {0}, 1e-3, {4.00, 23.17});
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
