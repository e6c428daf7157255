#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "estimator/allan/deviation.hpp"
#include "estimator/allan/synthetic.hpp"
#include "tests/unit/estimator/allan/support.hpp"

namespace {

using namespace vibrig::estimator::allan;
using vibrig::test::white;

TEST(Interval, ChiSquareQuantilesAgreeWithTables) {
    EXPECT_NEAR(chi_square_quantile(0.95, 1), 3.841458820694124, 1e-9);
    EXPECT_NEAR(chi_square_quantile(0.05, 10), 3.940299136076, 1e-9);
    EXPECT_NEAR(chi_square_quantile(0.999, 100), 149.4492525, 1e-6);
    EXPECT_NEAR(chi_square_quantile(0.5, 2), 2 * std::numbers::ln2, 1e-11);
    EXPECT_NEAR(chi_square_quantile(0.5, 1e5), 1e5 - 2.0 / 3, 1e-3);
}

TEST(NoiseIdentification, NamesTheFivePowerLaws) {
    // GIVEN pure noise types, flicker PM left out: no coefficient here makes it
    const std::array<std::pair<Terms, Alpha>, 4> types{{{Terms{1, 0, 0, 0, 0}, 2},
                                                        {Terms{0, 1, 0, 0, 0}, 0},
                                                        {Terms{0, 0, 1, 0, 0}, -1},
                                                        {Terms{0, 0, 0, 1, 0}, -2}}};
    // WHEN each is identified in 20 records THEN the mean exponent is nearest to the true one
    constexpr unsigned kRuns = 20;
    for (const auto& [terms, alpha] : types) {
        for (const std::size_t m : {1U, 8U, 32U}) {
            double mean = 0;
            for (unsigned run = 0; run < kRuns; ++run) {
                const Series series =
                    Series::from_rate(synthetic_rate(terms, 4096, 1.0, 770 + run), 1.0);
                mean += identify_noise(series, m, 9) / double{kRuns};
            }
            EXPECT_NEAR(mean, alpha, 0.5) << "m = " << m << ", seeds from 770";
        }
    }
    const Series brief = Series::from_rate(synthetic_rate(types[1].first, 28, 1.0, 1), 1.0);
    EXPECT_EQ(identify_noise(brief, 10, 9), 9);
}

TEST(NoiseIdentification, DoesNotMistakeARowOfWhiteNoise) {
    // GIVEN 200 records of white FM WHEN each row's noise is identified for its interval
    constexpr int kRuns = 200;
    constexpr std::size_t kSamples = 4096;
    std::size_t rows = 0;
    std::size_t narrow = 0;
    for (unsigned run = 0; run < kRuns; ++run) {
        const Series series = Series::from_rate(white(kSamples, 1, 5000 + run), 1.0);
        for (const Point& p : deviations(series, Statistic::oadev, octave_factors(kSamples / 2))) {
            ++rows;
            narrow += p.edf > 2 * edf(Statistic::oadev, 0, kSamples + 1, p.m) ? 1U : 0U;
        }
    }
    // THEN none is more than 1.4 times too narrow: the exponent's error is 0.14 and half of one is
    // 3.5 of it, 5e-4; three times that for the few rows that share their points
    EXPECT_LE(narrow, static_cast<std::size_t>(1.5e-3 * static_cast<double>(rows)))
        << "of " << rows << ", seeds from 5000";
}

TEST(NoiseIdentification, WhereTwoNoisesCrossTheIntervalIsNotTooNarrow) {
    // GIVEN angle quantisation that a rate random walk takes over from, with or without white noise
    for (const Terms& terms :
         {Terms{0.1, 0.001, 0, 0.02, 0}, Terms{0.1, 0, 0, 0.02, 0}, Terms{0.1, 0, 0, 0.2, 0}}) {
        for (unsigned run = 0; run < 2; ++run) {
            const Series series =
                Series::from_rate(synthetic_rate(terms, 36000, 1.0, 300 + run), 1.0);
            const auto rows = deviations(series, Statistic::oadev, octave_factors(4096));
            // THEN longer averages never have more degrees of freedom
            for (std::size_t k = 2; k < rows.size(); ++k)
                EXPECT_LE(rows[k].edf, rows[k - 1].edf)
                    << "m = " << rows[k].m << ", seed " << 300 + run;
        }
    }
    // AND they are no more than the values' own scatter shows
    constexpr int kRuns = 200;
    constexpr std::size_t kShort = 2000;
    for (const std::size_t m : {16U, 32U}) {
        double sum = 0, squares = 0, stated = 0;
        for (unsigned run = 0; run < kRuns; ++run) {
            const Series series = Series::from_rate(
                synthetic_rate({0.1, 0.001, 0, 0.02, 0}, kShort, 1.0, 40'000 + run), 1.0);
            const Point point =
                deviations(series, Statistic::oadev, std::vector<std::size_t>{m})[0];
            sum += point.dev * point.dev / kRuns;
            squares += std::pow(point.dev, 4) / kRuns;
            stated += point.edf / kRuns;
        }
        const double found = 2 * sum * sum / (squares - sum * sum);
        EXPECT_LE(stated, found * (1 + 4 * std::sqrt(2.0 / kRuns)))
            << "m = " << m << ", seeds from 40000";
    }
}

/// tr(C)^2 / tr(C^2) of differences with this covariance C, which a difference of white FM has.
double edf_of_white_frequency(std::size_t points, std::size_t m, std::size_t order,
                              std::size_t stride) {
    const std::vector<double> weight =
        order == 2 ? std::vector<double>{1, -2, 1} : std::vector<double>{-1, 3, -3, 1};
    double squares = 0, own = 0;
    const std::size_t rows = (points - order * m - 1) / stride + 1;
    for (std::size_t i = 0; i < rows; ++i) {
        for (std::size_t k = 0; k < rows; ++k) {
            double c = 0;
            for (std::size_t a = 0; a <= order; ++a) {
                for (std::size_t b = 0; b <= order; ++b)
                    c += weight[a] * weight[b] *
                         static_cast<double>(std::min(i * stride + a * m, k * stride + b * m));
            }
            squares += c * c;
            if (i == k) own += c;
        }
    }
    return own * own / squares;
}

TEST(Interval, DegreesOfFreedomOfWhiteFrequencyAreExact) {
    // GIVEN the phase of white FM, a random walk that is read, not averaged
    constexpr std::size_t kPoints = 301;
    struct Case {
        Statistic statistic;
        std::size_t order;
        bool overlapping;
    };
    for (const Case& c : {Case{Statistic::adev, 2, false}, Case{Statistic::hdev, 3, false},
                          Case{Statistic::ohdev, 3, true}}) {
        for (const std::size_t m : {1U, 2U, 4U, 16U}) {
            const double exact = edf_of_white_frequency(kPoints, m, c.order, c.overlapping ? 1 : m);
            // THEN they are those of the differences' covariance
            EXPECT_NEAR(edf(c.statistic, 0, kPoints, m) / exact, 1, 1e-6)
                << "order " << c.order << ", m = " << m;
        }
    }
    // AND the modified variance of single points is the plain one
    EXPECT_NEAR(edf(Statistic::mdev, 0, 1001, 1), 666, 1);
    EXPECT_NEAR(edf(Statistic::adev, 0, 1001, 1), 666, 1);
    EXPECT_NEAR(edf(Statistic::hdev, 0, 1001, 1), 513.5, 1);
}

TEST(Interval, TotalDeviationOfWhitePhaseKnowsItsReflectedEnds) {
    // GIVEN white phase WHEN its total variance is taken 1000 times
    constexpr int kRuns = 1000;
    constexpr std::size_t kPhase = 401;
    for (const std::size_t m : {1U, 4U, 40U, 100U, 180U}) {
        double sum = 0;
        double squares = 0;
        for (unsigned run = 0; run < kRuns; ++run) {
            const Series series = Series::from_phase(white(kPhase, 1, 9100 + run), 1.0);
            const double dev =
                deviations(series, Statistic::totdev, std::vector<std::size_t>{m})[0].dev;
            sum += dev * dev / kRuns;
            squares += std::pow(dev, 4) / kRuns;
        }
        const double found = 2 * sum * sum / (squares - sum * sum);
        // THEN edf is 2 mean^2 / variance: its relative error is sqrt((2 + 12 / edf) / runs)
        const double stated = edf(Statistic::totdev, 2, kPhase, m);
        EXPECT_NEAR(found / stated, 1, 4 * std::sqrt((2 + 12 / stated) / kRuns))
            << "m = " << m << ", seeds from 9100";
    }
}

}  // namespace
