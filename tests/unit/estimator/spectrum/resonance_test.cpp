#include "estimator/spectrum/resonance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/spectrum/analysis.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using namespace testing;

double weight_of(const Mixture& gyro, bool resonant) {
    double sum = 0;
    for (const Hypothesis& one : gyro.list)
        sum += one.resonances.empty() != resonant ? one.weight : 0;
    return sum;
}

/// A gyro of the survey whose coefficients are elastic by a share, its rates with their noise.
Mixture of_share(double share) {
    std::mt19937_64 random(1);
    Dwells dwells = dwells_of({}, Truth::common(share, kSixty), survey());
    add_noise(dwells, random);
    const SpectralTable table({}, dwells.list, dwells.kinds);
    GyroProblem problem{Eigen::VectorXd(63), 4.891201e-5 * Eigen::MatrixXd::Identity(63, 63),
                        Eigen::VectorXd::Constant(10, 10)};
    problem.prior_sigma.tail(6).setConstant(1);
    for (Eigen::Index k = 0; k < 63; ++k)
        problem.rate[k] = dwells.list[static_cast<std::size_t>(k)].row.rate[0];
    return one_resonance(table, 0, problem);
}

/// Log odds of 1: 73 % a resonance, on many hypotheses, each of which weighs less than none does.
TEST(Resonance, IsDecidedByAllThatItWeighsAndNotByItsHeaviestHypothesis) {
    double low = 0, high = 0.05;
    for (int i = 0; i < 20; ++i) {
        const double middle = (low + high) / 2;
        (of_share(middle).log_odds < 1 ? low : high) = middle;
    }
    const Mixture found = of_share(high);
    ASSERT_NEAR(found.log_odds, 1, 0.2);
    EXPECT_NEAR(weight_of(found, true), 1 / (1 + std::exp(-found.log_odds)), 0.01);
    EXPECT_GT(weight_of(found, false), found.list.front().weight);
    EXPECT_TRUE(found.resonant());
    EXPECT_FALSE(found.named());
    EXPECT_EQ(found.degrees, 63 - 18);
    ASSERT_EQ(estimates(found).size(), 1U);
    EXPECT_GE(estimates(found)[0].hz.low, kLowestResonance);
    EXPECT_LE(estimates(found)[0].hz.high, kHighestResonance);
    const Mixture none = of_share(0);
    EXPECT_LT(none.log_odds, 0);
    EXPECT_FALSE(none.resonant());
    EXPECT_EQ(none.degrees, 63 - 10);
    EXPECT_TRUE(estimates(none).empty());
}

/// What is known of the ten, where both weigh: static under a resonance, else as they are at 15 Hz.
TEST(Resonance, WeighsInWhatIsKnownOfTheTenCoefficients) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
        const Analysis found = campaign(undeclared(), Truth::common(0.003, kSixty), survey(), seed);
        bool any = false;
        for (std::size_t j = 0; j < 3; ++j) {
            const Mixture& gyro = found.gyros[j];
            EXPECT_EQ(gyro.resonant(), weight_of(gyro, true) > weight_of(gyro, false));
            any |= gyro.resonant();
            double value = 0, square = 0;
            for (const Hypothesis& one : gyro.list) {
                const bool at_15 = !gyro.resonant() && !one.resonances.empty();
                const double w = at_15 ? in_phase(15, one.resonances[0]) - 1 : 0;
                const auto& c = one.covariance;
                const double x = one.x[4] + (at_15 ? w * one.x[kBase] : 0);
                value += one.weight * x;
                square +=
                    one.weight *
                    (x * x + c(4, 4) + (at_15 ? 2 * w * c(4, kBase) + w * w * c(kBase, kBase) : 0));
            }
            const Eigen::Index at = 3 * 4 + static_cast<Eigen::Index>(j);
            EXPECT_NEAR(found.value[at], value, 1e-12);
            EXPECT_NEAR(found.covariance_a(at, at), square - value * value, 1e-12);
        }
        EXPECT_EQ(found.form, any ? Form::resonance : Form::flat) << "seed " << seed;
    }
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
