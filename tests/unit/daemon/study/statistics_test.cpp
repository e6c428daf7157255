#include "daemon/study/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace vibrig::study {
namespace {

TEST(StudySum, KeepsWhatRoundingTakes) {
    Sum sum;
    for (const double x : {1.0, 1e100, 1.0, -1e100}) sum.add(x);
    EXPECT_EQ(sum.value(), 2);
}

TEST(StudyIntervals, AreThoseOfTheTables) {
    // R: binom.test(8, 10): 0.4439045 to 0.9747893
    const Interval share = share_interval(8, 10);
    EXPECT_NEAR(share.low, 0.4439045, 1e-6);
    EXPECT_NEAR(share.high, 0.9747893, 1e-6);
    EXPECT_EQ(share_interval(0, 10).low, 0);
    EXPECT_EQ(share_interval(10, 10).high, 1);
    EXPECT_NEAR(share_interval(10, 10).low, std::pow(0.025, 0.1), 1e-12);
    // qchisq(c(0.025, 0.975), 10): 3.246973, 20.48318
    const Interval rms = rms_interval(10, 10);
    EXPECT_NEAR(rms.value, 1, 1e-15);
    EXPECT_NEAR(rms.low, std::sqrt(10 / 20.48318), 1e-6);
    EXPECT_NEAR(rms.high, std::sqrt(10 / 3.246973), 1e-6);
    // pchisq(43.77297, 30) = 0.95
    EXPECT_NEAR(chi_square_mean(43.77297, 1, 30).p, 0.1, 1e-6);
}

TEST(StudyIntervals, HoldTheTruthNineteenTimesInTwenty) {
    const std::uint64_t seed = 3;
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    constexpr int kTimes = 2000, kEach = 20;
    int rms_holds = 0, mean_holds = 0;
    for (int t = 0; t < kTimes; ++t) {
        double sum = 0;
        for (int i = 0; i < kEach; ++i) {
            const double x = normal(random);
            sum += x * x;
        }
        const Interval rms = rms_interval(sum, kEach);
        rms_holds += rms.low <= 1 && 1 <= rms.high ? 1 : 0;
        mean_holds += chi_square_mean(sum, 1, kEach).p >= 0.05 ? 1 : 0;
    }
    // Five standard deviations of a count.
    const double spread = 5 * std::sqrt(kTimes * 0.95 * 0.05);
    EXPECT_NEAR(rms_holds, 0.95 * kTimes, spread) << "seed " << seed;
    EXPECT_NEAR(mean_holds, 0.95 * kTimes, spread) << "seed " << seed;
}

TEST(StudyIntervals, OfManyDegreesGoOnWhereTheLibraryEnds) {
    // On both sides of where another formula begins.
    for (const double degrees : {19'990.0, 20'010.0}) {
        const ChiSquareMean mean = chi_square_mean(degrees, 1, degrees);
        EXPECT_NEAR(mean.low / degrees, 1 - 1.959964 * std::sqrt(2 / degrees), 1e-4);
        EXPECT_NEAR(mean.high / degrees, 1 + 1.959964 * std::sqrt(2 / degrees), 1e-4);
        EXPECT_NEAR(chi_square_mean(mean.high, 1, degrees).p, 0.05, 1e-5);
    }
    const double jump =
        chi_square_mean(20'010, 1, 20'010).high - chi_square_mean(19'990, 1, 19'990).high;
    // d (degrees + z sqrt(2 degrees)) for 20 degrees more
    EXPECT_NEAR(jump, 20 * (1 + 1.959964 / std::sqrt(2 * 20'000.0)), 1e-3);
    EXPECT_NEAR(chi_square_mean(3e8, 10'000'000, 30).p, 1, 1e-3);
    EXPECT_EQ(chi_square_mean(1e8, 1'000'000, 30).p, 0);
    EXPECT_NEAR(rms_interval(1e7, 10'000'000).high, 1 + 1.959964 / std::sqrt(2e7), 1e-6);
}

TEST(StudyIntervals, BinsAreEquallyLikely) {
    const auto bounds = chi_square_bounds(4, 30);
    ASSERT_EQ(bounds.size(), 3U);
    EXPECT_NEAR(bounds[0], 24.47761, 1e-4);  // qchisq(0.25, 30)
    EXPECT_NEAR(bounds[1], 29.33603, 1e-4);
    EXPECT_NEAR(bounds[2], 34.79974, 1e-4);
}

TEST(StudyCampaigns, HaveNoNeesWithoutACovariance) {
    const Eigen::VectorXd error = Eigen::VectorXd::Ones(2);
    Eigen::MatrixXd covariance(2, 2);
    covariance << 4, 0, 0, 1;
    EXPECT_NEAR(nees(error, covariance), 1.25, 1e-15);
    covariance << 1, 2, 2, 1;  // indefinite
    EXPECT_TRUE(std::isnan(nees(error, covariance)));
    covariance << 1, 1, 1, 1 - 1e-9;
    EXPECT_TRUE(std::isnan(nees(error, covariance)));
    EXPECT_TRUE(std::isnan(nees(error, Eigen::MatrixXd())));
}

}  // namespace
}  // namespace vibrig::study
