#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "estimator/allan/deviation.hpp"
#include "estimator/allan/sliding_variance.hpp"
#include "tests/unit/estimator/allan/support.hpp"

namespace {

using namespace vibrig::estimator::allan;
using vibrig::test::kNaN;
using vibrig::test::white;

/// AVAR of the last `window` rates by the batch code.
double batch(const std::vector<double>& rate, std::size_t window, std::size_t m) {
    const std::span<const double> last = std::span(rate).last(window);
    const auto points =
        deviations(Series::from_rate(last, 0.5), Statistic::oadev, std::vector<std::size_t>{m});
    return points.empty() ? kNaN : points[0].dev * points[0].dev;
}

double batch_classical(const std::vector<double>& rate, std::size_t window, std::size_t m,
                       double mean) {
    double sum = 0;
    std::size_t terms = 0;
    for (std::size_t i = rate.size() - window; i + m <= rate.size(); ++i) {
        double average = 0;
        for (std::size_t j = 0; j < m; ++j) {
            average += rate[i + j] / static_cast<double>(m);
        }
        if (std::isfinite(average)) {
            sum += (average - mean) * (average - mean);
            ++terms;
        }
    }
    return sum / static_cast<double>(terms);
}

TEST(SlidingVariance, EqualsTheBatchAtEveryLengthOfStreamWithGapsAndAnOffset) {
    // GIVEN noise on a large mean, with single and long gaps, some across a recomputation

    constexpr std::size_t kWindow = 100;
    std::vector<double> rate = white(730, 0.1, 17);
    for (std::size_t i = 0; i < rate.size(); ++i) {
        rate[i] += 15;
        if (i % 97 == 50 || (i >= 398 && i < 405)) {
            rate[i] = kNaN;
        }
    }
    const std::vector<std::size_t> factors{1, 2, 3, 7, 25, 50};
    SlidingVariance sliding(0.5, kWindow, factors);
    // WHEN the stream is followed sample by sample
    std::vector<double> seen;
    for (const double y : rate) {
        sliding.add(y);
        seen.push_back(y);
        if (!sliding.full()) {
            continue;
        }
        // THEN every window agrees with the batch
        double sum = 0;
        std::size_t missing = 0;
        for (std::size_t i = seen.size() - kWindow; i < seen.size(); ++i) {
            sum += std::isfinite(seen[i]) ? seen[i] : 0;
            missing += std::isfinite(seen[i]) ? 0U : 1U;
        }
        const double mean = sum / static_cast<double>(kWindow - missing);
        ASSERT_EQ(sliding.missing(), missing) << seen.size();
        ASSERT_NEAR(sliding.mean(), mean, 1e-11) << seen.size();
        for (std::size_t k = 0; k < factors.size(); ++k) {
            const double expected = batch(seen, kWindow, factors[k]);
            ASSERT_EQ(sliding.share(k) > 0, std::isfinite(expected)) << seen.size();
            if (std::isnan(expected)) {
                ASSERT_TRUE(std::isnan(sliding.allan(k))) << factors[k];
                continue;
            }
            ASSERT_NEAR(sliding.allan(k), expected, 1e-9 * expected + 1e-18)
                << "m = " << factors[k] << " after " << seen.size();
            if (factors[k] <= 25) {
                const double classical = batch_classical(seen, kWindow, factors[k], mean);
                ASSERT_NEAR(sliding.classical(k, mean), classical, 1e-8 * classical)
                    << "m = " << factors[k] << " after " << seen.size();
            }
        }
    }
    EXPECT_EQ(sliding.faults(), 0U);
}

TEST(SlidingVariance, CountsAFaultWhenARunningSumHasLostItsDigits) {
    // GIVEN a value so large that its square swallows the rest of the sum
    SlidingVariance sliding(1.0, 64, {1, 4});
    std::vector<double> rate = white(256, 1.0, 3);
    rate[70] = 1e12;
    // WHEN it has left the window
    for (const double y : rate) {
        sliding.add(y);
    }
    // THEN the exact recomputation finds the error, counts it and repairs the sum
    EXPECT_GT(sliding.faults(), 0U);
    double expected = 0;
    for (std::size_t i = 256 - 64; i + 1 < 256; ++i) {
        expected += std::pow(rate[i + 1] - rate[i], 2) / (2 * 63.0);
    }
    EXPECT_NEAR(sliding.allan(0), expected, 1e-9 * expected);
}

TEST(SlidingVariance, WhereGapsLeaveNothingThereIsNoValueAndNoFault) {
    // GIVEN a window with a gap in its middle
    constexpr std::size_t kWindow = 32;
    SlidingVariance sliding(1.0, kWindow, {1, 4, 12});
    std::vector<double> rate = white(kWindow, 0.1, 5);
    for (double& y : rate) y += 15;
    rate[16] = kNaN;
    for (const double y : rate) sliding.add(y);
    // THEN what needs more than is left on either side has no value, by whatever weights
    EXPECT_GT(sliding.allan(1), 0);
    for (const WindowShape shape :
         {WindowShape::rectangular, WindowShape::hann, WindowShape::exponential})
        EXPECT_TRUE(std::isnan(sliding.allan(2, shape)));
    EXPECT_EQ(sliding.share(2), 0);
    // WHEN nothing comes for three windows THEN there is no mean, and none of an earlier one
    for (std::size_t i = 0; i < 3 * kWindow; ++i) sliding.add(kNaN);
    EXPECT_EQ(sliding.missing(), kWindow);
    EXPECT_TRUE(std::isnan(sliding.mean()));
    for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_TRUE(std::isnan(sliding.allan(k))) << k;
        EXPECT_TRUE(std::isnan(sliding.classical(k, 0))) << k;
        EXPECT_TRUE(std::isnan(sliding.tiled(k).variance)) << k;
    }
    // AND afterwards all is as of the samples alone
    rate = white(kWindow, 0.1, 6);
    double mean = 0;
    for (double& y : rate) mean += (y += 15) / kWindow;
    for (const double y : rate) sliding.add(y);
    EXPECT_NEAR(sliding.mean(), mean, 1e-12);
    double expected = 0;
    for (std::size_t i = 1; i < kWindow; ++i)
        expected += std::pow(rate[i] - rate[i - 1], 2) / (2 * (kWindow - 1.0));
    EXPECT_NEAR(sliding.allan(0), expected, 1e-9 * expected);
    EXPECT_EQ(sliding.share(0), 1);
    EXPECT_EQ(sliding.faults(), 0U);
}

TEST(SlidingVariance, MonteCarloTheShareIsThatOfTheDegreesOfFreedomBetweenGaps) {
    // GIVEN white noise of variance 1 with the same gaps, 1 % of the samples, in 4000 windows
    constexpr std::size_t kWindow = 400;
    constexpr unsigned kRuns = 4000;
    const std::vector<std::size_t> factors{1, 8, 32};
    std::vector<double> squares(factors.size(), 0.0), share(factors.size(), 0.0);
    for (unsigned run = 0; run < kRuns; ++run) {
        SlidingVariance sliding(1.0, kWindow, factors);
        std::vector<double> rate = white(kWindow, 1, 9400 + run);
        for (const std::size_t gone : {70U, 150U, 260U, 275U}) rate[gone] = kNaN;
        for (const double y : rate) sliding.add(y);
        for (std::size_t k = 0; k < factors.size(); ++k) {
            const double relative = sliding.allan(k) * static_cast<double>(factors[k]) - 1;
            squares[k] += relative * relative / kRuns;
            share[k] = sliding.share(k);
        }
    }
    for (std::size_t k = 0; k < factors.size(); ++k) {
        // THEN the variance varies by 2 over the degrees stated. A variance of 4000 is known within
        // sqrt(2 / 4000) = 2.2 %, of few degrees twice that; SP 1065 is good to 5 %.
        const double degrees = share[k] * edf(Statistic::oadev, 0, kWindow + 1, factors[k]);
        EXPECT_NEAR(squares[k] * degrees / 2, 1, 4 * 0.03 + 0.05)
            << "m = " << factors[k] << ", seeds from 9400";
    }
}

TEST(SlidingVariance, RefusesAWindowTooShortForItsFactors) {
    EXPECT_THROW(SlidingVariance(1.0, 10, {1, 6}), DataError);
    EXPECT_THROW(SlidingVariance(1.0, 10, {}), DataError);
    EXPECT_THROW(SlidingVariance(0.0, 10, {1}), DataError);
    EXPECT_THROW(SlidingVariance(kNaN, 10, {1}), DataError);
}

TEST(WindowShape, WeighsAndKnowsWhatItCosts) {
    // GIVEN 2000 windows of white noise
    constexpr std::size_t kWindow = 128;
    constexpr int kRuns = 2000;
    const std::vector<std::size_t> factors{1, 2};
    for (const WindowShape shape :
         {WindowShape::rectangular, WindowShape::hann, WindowShape::exponential}) {
        double sum = 0;
        double squares = 0;
        for (unsigned run = 0; run < kRuns; ++run) {
            SlidingVariance sliding(1.0, kWindow, factors);
            for (const double y : vibrig::test::white(kWindow, 1, 6200 + run)) sliding.add(y);
            const double v = sliding.allan(0, shape);
            sum += v / kRuns;
            squares += v * v / kRuns;
        }
        // THEN none is biased: edf by SP 1065 times the share, 1 sigma sqrt(2 / edf / runs)
        const double degrees = edf(Statistic::oadev, 0, kWindow + 1, 1) * share_of(shape);
        EXPECT_NEAR(sum, 1, 4 * std::sqrt(2 / degrees / kRuns)) << "seeds from 6200";
        // and the spread is as stated, 1 sigma sqrt(2 / runs) = 3.2 %, ends of the window 3 %
        EXPECT_NEAR(2 * sum * sum / (squares - sum * sum) / degrees, 1, 4 * 0.032 + 0.03)
            << static_cast<int>(shape) << ", seeds from 6200";
    }
    // A step of the noise in the newest quarter shows most in the exponential window
    SlidingVariance sliding(1.0, kWindow, factors);
    auto rate = vibrig::test::white(kWindow, 1, 6100);
    for (std::size_t i = 3 * kWindow / 4; i < kWindow; ++i) rate[i] *= 3;
    for (const double y : rate) sliding.add(y);
    EXPECT_GT(sliding.allan(0, WindowShape::exponential), 1.3 * sliding.allan(0));
    EXPECT_LT(sliding.allan(0, WindowShape::hann), sliding.allan(0));
}

}  // namespace
