#include "estimator/allan/deviation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/allan/synthetic.hpp"
#include "tests/unit/estimator/allan/support.hpp"

namespace {

using namespace vibrig::estimator::allan;
using vibrig::test::kNaN;
using vibrig::test::white;

std::vector<Point> octaves(const std::vector<double>& rate, double tau0,
                           Statistic statistic = Statistic::oadev, double confidence = kOneSigma) {
    const Series series = Series::from_rate(rate, tau0);
    return deviations(series, statistic, octave_factors(rate.size() / 32), confidence);
}

/// Mean variance over `runs` records against what `expected` says, in standard errors.
template <typename Expected>
void compare(const Terms& terms, Statistic statistic, Expected expected) {
    constexpr std::uint64_t kSeed = 500;
    constexpr int kRuns = 12;
    constexpr double kTau0 = 2.0;
    std::vector<double> mean;
    std::vector<Point> last;
    for (int run = 0; run < kRuns; ++run) {
        last = octaves(synthetic_rate(terms, 8192, kTau0, kSeed + static_cast<unsigned>(run)),
                       kTau0, statistic);
        mean.resize(last.size(), 0.0);
        for (std::size_t k = 0; k < last.size(); ++k) {
            mean[k] += last[k].dev * last[k].dev / kRuns;
        }
    }
    for (std::size_t k = 0; k < last.size(); ++k) {
        const double truth = expected(last[k].tau);
        // Four standard errors of the mean variance, and 2 % for the generator's flicker.
        const double tolerance = 4 * std::sqrt(2 / (last[k].edf * kRuns)) + 0.02;
        EXPECT_NEAR(mean[k] / truth, 1, tolerance)
            << name_of(statistic) << " tau " << last[k].tau << ", seeds from " << kSeed;
    }
}

TEST(ClosedForm, OverlappingAllanVarianceOfEachNoiseType) {
    // GIVEN one noise type at a time WHEN its variance is averaged over records
    // THEN it follows the closed form of IEEE Std 952
    for (std::size_t j = 0; j < 4; ++j) {
        Terms terms{};
        terms[j] = 0.3;
        compare(terms, Statistic::oadev, [&](double tau) { return model_variance(terms, tau); });
    }
}

TEST(ClosedForm, ARampIsExact) {
    // GIVEN a pure ramp of 7 deg/h^2 WHEN, THEN every point is R tau / sqrt(2) without noise
    const std::vector<double> rate = synthetic_rate({0, 0, 0, 0, 7}, 512, 10.0, 1);
    for (const Point& p : octaves(rate, 10.0)) {
        EXPECT_NEAR(p.dev, 7 * (p.tau / 3600) / std::numbers::sqrt2, 1e-11);
    }
    // and the Hadamard deviation does not see it
    for (const Point& p : octaves(rate, 10.0, Statistic::ohdev)) {
        EXPECT_NEAR(p.dev, 0, 1e-11);
    }
}

TEST(ClosedForm, OtherStatisticsOfWhiteNoise) {
    // White FM: HVAR = AVAR, TOTVAR = AVAR (1 - 0 tau/T), MVAR -> AVAR / 2 for large m (SP 1065).
    Terms terms{};
    terms[1] = 0.3;
    const auto allan = [&](double tau) { return model_variance(terms, tau); };
    compare(terms, Statistic::adev, allan);
    compare(terms, Statistic::hdev, allan);
    compare(terms, Statistic::ohdev, allan);
    compare(terms, Statistic::totdev, allan);
    const auto modified = [&](double tau) {
        const double m = tau / 2.0;
        return allan(tau) * (m * m + 1) / (2 * m * m);
    };
    compare(terms, Statistic::mdev, modified);
    compare(terms, Statistic::tdev, [&](double tau) { return modified(tau) * tau * tau / 3; });
}

TEST(Interval, CoversTheTruthAsOftenAsItSays) {
    // GIVEN 200 records of white noise and 90 % intervals
    constexpr int kRuns = 200;
    for (const Statistic statistic : {Statistic::adev, Statistic::oadev, Statistic::mdev,
                                      Statistic::hdev, Statistic::ohdev, Statistic::totdev}) {
        std::array<int, 4> inside{};
        const std::array<std::size_t, 4> factors{1, 4, 16, 48};
        for (int run = 0; run < kRuns; ++run) {
            const Series series =
                Series::from_rate(white(512, 1.0, 9000 + static_cast<unsigned>(run)), 1.0);
            const auto points = deviations(series, statistic, factors, 0.9);
            for (std::size_t k = 0; k < factors.size(); ++k) {
                const auto m = static_cast<double>(factors[k]);
                const double half = statistic == Statistic::mdev ? (m * m + 1) / (2 * m * m) : 1;
                const double truth = std::sqrt(half / m);
                inside[k] += points[k].lo <= truth && truth <= points[k].hi ? 1 : 0;
            }
        }
        // WHEN, THEN coverage is 90 % within four binomial standard errors (8.5 %); the noise type
        // is identified from the data, which costs a little more at large m
        for (std::size_t k = 0; k < factors.size(); ++k) {
            EXPECT_NEAR(inside[k] / double{kRuns}, 0.9, 0.1)
                << name_of(statistic) << " m = " << factors[k] << ", seeds from 9000";
        }
    }
}

TEST(Gap, NoDifferenceSpansIt) {
    // GIVEN two quiet halves with a step of the angle hidden in the gap between them
    std::vector<double> phase(201);
    for (std::size_t i = 0; i < phase.size(); ++i) {
        phase[i] = (i % 2 == 0 ? 1e-3 : -1e-3) + (i > 100 ? 1e6 : 0);
    }
    phase[100] = kNaN;
    // WHEN the deviation is taken
    const auto points =
        deviations(Series::from_phase(phase, 1.0), Statistic::oadev, octave_factors(100));
    // THEN the step is not seen, and factors that do not fit into a half are left out
    ASSERT_FALSE(points.empty());
    EXPECT_EQ(points.back().m, 32U);
    EXPECT_NEAR(points[0].dev, 4e-3 / std::numbers::sqrt2, 1e-6);
    EXPECT_EQ(points[0].n, 98U + 98U);
}

TEST(Gap, LowersTheDegreesOfFreedomAndKeepsTheDeviation) {
    // GIVEN white noise with and without a missing twentieth
    std::vector<double> rate = white(20000, 1.0, 5);
    const auto whole = octaves(rate, 1.0);
    for (std::size_t i = 0; i < rate.size(); i += 200) {
        std::fill_n(rate.begin() + static_cast<std::ptrdiff_t>(i), 10, kNaN);
    }
    const Series series = Series::from_rate(rate, 1.0);
    EXPECT_EQ(series.missing, 1000U);
    EXPECT_EQ(series.longest_gap, 10U);
    const auto gappy = deviations(series, Statistic::oadev, octave_factors(64));
    // WHEN, THEN dev agrees within the intervals and edf falls
    ASSERT_GE(gappy.size(), 6U);
    for (std::size_t k = 0; k < gappy.size(); ++k) {
        EXPECT_LT(gappy[k].edf, whole[k].edf);
        EXPECT_NEAR(gappy[k].dev / whole[k].dev, 1, 4 / std::sqrt(2 * gappy[k].edf)) << gappy[k].m;
    }
    EXPECT_THROW(static_cast<void>(deviations(series, Statistic::totdev, octave_factors(4))),
                 DataError);
}

TEST(Gap, NeverRaisesTheDegreesOfFreedom) {
    // GIVEN 100 records of white noise, one sample in 997 missing, WHEN the noise is identified
    constexpr std::uint64_t kSeed = 9000;
    constexpr std::size_t kSamples = 20000;
    for (std::uint64_t run = 0; run < 100; ++run) {
        std::vector<double> rate = white(kSamples, 1.0, kSeed + run);
        for (std::size_t i = 500; i < rate.size(); i += 997) {
            rate[i] = kNaN;
        }
        const auto gappy =
            deviations(Series::from_rate(rate, 1.0), Statistic::oadev, octave_factors(256));
        ASSERT_EQ(gappy.size(), 9U);
        for (const Point& point : gappy) {
            // THEN it is white FM at every factor, with fewer degrees of freedom than without gaps
            EXPECT_EQ(point.alpha, 0) << "m " << point.m << ", seed " << kSeed + run;
            EXPECT_LT(point.edf, edf(Statistic::oadev, 0, kSamples + 1, point.m))
                << "m " << point.m << ", seed " << kSeed + run;
        }
    }
}

}  // namespace
