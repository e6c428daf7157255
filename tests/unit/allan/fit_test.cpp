#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "estimator/allan/classical.hpp"
#include "estimator/allan/deviation.hpp"
#include "estimator/allan/fit.hpp"
#include "estimator/allan/synthetic.hpp"

namespace {

using namespace vibrig::estimator::allan;

constexpr std::size_t kPoints = 36001;

std::vector<VariancePoint> exact_curve(const Terms& terms) {
    std::vector<VariancePoint> curve;
    for (const std::size_t m : log_factors(18000, 30)) {
        const auto tau = static_cast<double>(m);
        curve.push_back({tau, m, model_variance(terms, tau), 1.0});
    }
    return curve;
}

Fit fit_record(const std::vector<double>& rate) {
    std::vector<VariancePoint> curve;
    for (const Point& p : deviations(Series::from_rate(rate, 1.0), Statistic::oadev,
                                     log_factors(rate.size() / 2, 30))) {
        curve.push_back({p.tau, p.m, p.dev * p.dev, 1.0});
    }
    return fit_noise(curve, rate.size() + 1, 1.0);
}

TEST(Fit, RecoversEachCoefficientFromAnExactCurve) {
    // GIVEN the curve without noise WHEN fitted THEN all five come back
    const Terms truth{0.1, 0.001, 0.01, 0.02, 0.02};
    const Fit fit = fit_noise(exact_curve(truth), kPoints, 1.0);
    for (std::size_t j = 0; j < kTerms; ++j) {
        EXPECT_TRUE(fit.terms[j].detected) << kTermNames[j];
        EXPECT_NEAR(fit.terms[j].value, truth[j], 1e-6 * truth[j]) << kTermNames[j];
        EXPECT_GT(fit.terms[j].sigma, 0) << kTermNames[j];
    }
}

TEST(Fit, SaysNotDetectedWithABoundForWhatIsNotThere) {
    // GIVEN white noise and quantisation only
    const Terms truth{0.1, 0.001, 0, 0, 0};
    // WHEN
    const Fit fit = fit_noise(exact_curve(truth), kPoints, 1.0);
    // THEN the others are zero, below a bound that is not silly: at its best tau the bound adds one
    // standard error to the curve
    for (const Term term : {Term::B, Term::K, Term::R}) {
        const FittedTerm& found = fit.terms[static_cast<std::size_t>(term)];
        EXPECT_FALSE(found.detected && found.value > 1e-6) << static_cast<int>(term);
        EXPECT_GT(found.below, 1e-5);
        EXPECT_LT(found.below, 0.1);
    }
}

TEST(Fit, MonteCarloErrorsStayWithinTheirLimits) {
    // GIVEN 60 records of 10 h at 1 Hz
    constexpr int kRuns = 60;
    constexpr std::uint64_t kSeed = 4000;
    const Terms truth{0.1, 0.001, 0.01, 0.02, 0.02};
    Terms squares{};
    Terms reported{};
    for (int run = 0; run < kRuns; ++run) {
        const Fit fit =
            fit_record(synthetic_rate(truth, kPoints - 1, 1.0, kSeed + static_cast<unsigned>(run)));
        for (std::size_t j = 0; j < kTerms; ++j) {
            squares[j] += std::pow(fit.values()[j] / truth[j] - 1, 2) / kRuns;
            reported[j] += fit.terms[j].detected ? fit.terms[j].sigma / truth[j] / kRuns : 0;
        }
    }
    // WHEN, THEN rms errors are at most 2, 3, 10, 60, 60 %
    const Terms limit{0.02, 0.03, 0.10, 0.60, 0.60};
    for (std::size_t j = 0; j < kTerms; ++j) {
        EXPECT_LT(std::sqrt(squares[j]), limit[j]) << kTermNames[j] << ", seeds from " << kSeed;
        EXPECT_GT(std::sqrt(squares[j]), reported[j] / 4) << kTermNames[j];
    }
}

TEST(Fit, TellsWhenARampCannotBeSeparatedFromARandomWalk) {
    // GIVEN a strong random walk and a weak ramp
    const Fit fit = fit_noise(exact_curve({0, 0.001, 0, 0.5, 0.05}), kPoints, 1.0);
    // THEN the bound K / sqrt(T) = 0.158 deg/h^2 and a record length are named
    EXPECT_NE(fit.ramp_note.find("0.158"), std::string::npos) << fit.ramp_note;
    EXPECT_NE(fit.ramp_note.find("a record of 400 h"), std::string::npos) << fit.ramp_note;
    EXPECT_GE(fit.terms[4].sigma, 0.158);
    EXPECT_TRUE(fit_noise(exact_curve({0, 0.001, 0, 0, 5}), kPoints, 1.0).ramp_note.empty());
}

TEST(Fit, NeedsTwoPoints) { EXPECT_THROW(static_cast<void>(fit_noise({}, 10, 1.0)), DataError); }

TEST(Classical, MultipliersMapItToTheAllanVariance) {
    EXPECT_DOUBLE_EQ(allan_multiplier(-2), 1.5);
    EXPECT_DOUBLE_EQ(allan_multiplier(-1), 1);
    EXPECT_DOUBLE_EQ(allan_multiplier(0), 0);
    EXPECT_DOUBLE_EQ(allan_multiplier(1), -2);
    EXPECT_DOUBLE_EQ(allan_multiplier(2), -6);
}

/// Double integral of the autocorrelation by the midpoint rule.
double integrated(const Oscillation& o, double tau) {
    constexpr int kSteps = 200000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double t = (i + 0.5) * tau / kSteps;
        sum += (tau - t) * std::exp(-t / o.tm) * std::cos(o.om * t);
    }
    return 2 * o.s * o.s * sum * (tau / kSteps) / (tau * tau);
}

TEST(Classical, ExactVarianceIsTheDoubleIntegralOfTheAutocorrelation) {
    for (const double om : {0.0, 0.003, 0.1}) {
        const Oscillation o{0.7, 120, om};
        for (const double tau : {0.5, 1.5, 30.0, 400.0}) {
            EXPECT_NEAR(classical_variance({&o, 1}, 0, tau), integrated(o, tau), 1e-8)
                << "om " << om << " tau " << tau;
        }
    }
}

TEST(Classical, LimitsHoldForSlowAndFastOscillations) {
    const auto sum = [](const Polynomial& a, double tau, std::initializer_list<std::size_t> terms) {
        double value = 0;
        for (const std::size_t k : terms) {
            value += a[k] * std::pow(tau, kPowers[k]);
        }
        return value;
    };
    const Oscillation slow{0.5, 1e4, 1e-4};
    EXPECT_NEAR(classical_variance({&slow, 1}, 0, 100), sum(limits_of(slow), 100, {0, 1, 2}), 1e-7);
    const Oscillation fast{0.5, 2, 1.5};
    EXPECT_NEAR(classical_variance({&fast, 1}, 0, 1e3), sum(limits_of(fast), 1e3, {3, 4}), 1e-12);
}

TEST(Classical, ASlowOscillationLooksLikeRateRandomWalk) {
    // GIVEN tau much below tm WHEN the Allan variance is taken THEN K^2 = 2 s^2 / tm (per second)
    const Oscillation o{0.02, 5400, 0};
    const double tau = 20;
    EXPECT_NEAR(allan_variance({&o, 1}, 0, tau), 2 * o.s * o.s / o.tm * tau / 3, 1e-8);
}

std::vector<ClassicalPoint> curve_of(const Polynomial& a, bool minus_window) {
    std::vector<ClassicalPoint> curve;
    for (const std::size_t m : log_factors(1200, 20)) {
        const auto tau = static_cast<double>(m);
        const double covered = std::floor(3600 / tau) * tau;
        double variance = 0;
        for (std::size_t k = 0; k < a.size(); ++k) {
            variance += a[k] * (std::pow(tau, kPowers[k]) -
                                (minus_window ? std::pow(covered, kPowers[k]) : 0));
        }
        curve.push_back({tau, variance, covered});
    }
    return curve;
}

TEST(Classical, OnlyAKnownMeanGivesA0) {
    const Polynomial a{0.0004, -2.4e-8, 1e-12, 0.0036, 0.02};
    // GIVEN deviations from the true mean: all five coefficients come back, and B
    const ClassicalFit known = fit_classical(curve_of(a, false), MeanMode::known_mean);
    ASSERT_TRUE(known.a0_known);
    for (std::size_t k = 0; k < a.size(); ++k) {
        EXPECT_NEAR(known.a[k], a[k], 1e-6 * std::abs(a[k])) << "a" << k;
    }
    EXPECT_NEAR(known.terms[2], 0.02 / 0.664, 1e-7);
    EXPECT_NEAR(known.terms[0], std::sqrt(0.5 * 0.02), 1e-7);
    EXPECT_NEAR(known.terms[1], 0.001, 1e-8);
    // With the window's mean removed the corrected basis returns the same, but no a0
    const ClassicalFit corrected = fit_classical(curve_of(a, true), MeanMode::corrected);
    EXPECT_FALSE(corrected.a0_known);
    EXPECT_TRUE(std::isnan(corrected.terms[2]));
    for (std::size_t k = 1; k < a.size(); ++k) {
        EXPECT_NEAR(corrected.a[k], a[k], 1e-6 * std::abs(a[k])) << "a" << k;
    }
    // and the free fit takes -(a1 T + a2 T^2 + ...) for it, and says so
    const ClassicalFit paper = fit_classical(curve_of(a, true), MeanMode::window_mean);
    EXPECT_LT(paper.a[0], 0.5 * a[0]);
    ASSERT_FALSE(paper.notes.empty());
    EXPECT_NE(paper.notes.back().find("not identifiable"), std::string::npos);
}

TEST(Classical, NegativeSumsAndSquaresAreNamed) {
    // GIVEN a fast class that is negative at short tau, with Q^2 < 0
    const ClassicalFit fit = interpret({0.1, -1e-8, 0, 0.01, -0.05}, true, 1, 1000);
    const auto says = [&](const std::string& words) {
        for (const std::string& note : fit.notes) {
            if (note.find(words) != std::string::npos) {
                return true;
            }
        }
        return false;
    };
    EXPECT_TRUE(std::isnan(fit.terms[0]));
    EXPECT_TRUE(says("Q: negative, not a quantisation term"));
    EXPECT_TRUE(says("the fast class is negative for tau from 1 to 4.9"));
    EXPECT_FALSE(says("slow"));
}

}  // namespace
