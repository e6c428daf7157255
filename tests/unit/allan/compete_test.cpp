#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>

#include "estimator/allan/deviation.hpp"
#include "estimator/allan/fit.hpp"
#include "estimator/allan/synthetic.hpp"

namespace {

using namespace vibrig::estimator::allan;

constexpr std::size_t kSamples = 36000;  // 10 h at 1 Hz

std::size_t at(Term term) { return static_cast<std::size_t>(term); }

struct Tally {
    int runs = 0;
    int slow = 0;
    std::array<int, kTerms> detected{};
    std::array<int, kTerms> outside{};  ///< truth beyond two sigma, or above the bound
    [[nodiscard]] double share_outside() const {
        int sum = 0;
        for (const int count : outside) sum += count;
        return sum / double(runs * static_cast<int>(kTerms));
    }
};

Tally tally(const Terms& truth, int runs, std::uint64_t seed, std::size_t samples = kSamples) {
    const std::vector<std::size_t> factors = log_factors(samples / 2, 30);
    const CurveCovariance covariance(factors, samples + 1, 1.0);
    Tally out;
    for (int run = 0; run < runs; ++run) {
        const auto rate = synthetic_rate(truth, samples, 1.0, seed + static_cast<unsigned>(run));
        std::vector<VariancePoint> curve;
        for (const Point& p : deviations(Series::from_rate(rate, 1.0), Statistic::oadev, factors)) {
            curve.push_back({p.tau, p.m, p.dev * p.dev, 1.0});
        }
        const Fit fit = fit_noise(curve, covariance);
        ++out.runs;
        out.slow += fit.slow.found ? 1 : 0;
        for (std::size_t j = 0; j < kTerms; ++j) {
            const FittedTerm& term = fit.terms[j];
            out.detected[j] += term.detected ? 1 : 0;
            const bool off = term.detected ? std::abs(term.value - truth[j]) > 2 * term.sigma
                                           : truth[j] > term.below;
            out.outside[j] += off ? 1 : 0;
        }
    }
    std::printf("N %g B %g K %g R %g: slow %d of %d; detected", truth[1], truth[2], truth[3],
                truth[4], out.slow, runs);
    for (std::size_t j = 0; j < kTerms; ++j) std::printf(" %s %d", kTermNames[j], out.detected[j]);
    std::printf("; outside");
    for (std::size_t j = 0; j < kTerms; ++j) std::printf(" %s %d", kTermNames[j], out.outside[j]);
    std::printf(" (seeds from %d)\n", static_cast<int>(seed));
    return out;
}

TEST(Compete, MonteCarloStrongRandomWalkIsFound) {
    // GIVEN N .001 with K .02: the deviation rises tenfold
    const Tally t = tally({0, 0.001, 0, 0.02, 0}, 100, 4100);
    EXPECT_EQ(t.slow, t.runs);
    EXPECT_EQ(t.detected[at(Term::N)], t.runs);
    std::printf("outside %.3f\n", t.share_outside());
}

TEST(Compete, MonteCarloWeakRandomWalkIsNoRamp) {
    const Tally t = tally({0, 0.001, 0, 0.004, 0}, 200, 4300);
    std::printf("outside %.3f\n", t.share_outside());
    tally({0, 0.001, 0, 0, 0}, 200, 4600);
    tally({0, 0.001, 0.003, 0, 0}, 100, 4900);
    tally({0, 0.001, 0, 0, 0.02}, 100, 5900);
    tally({0.1, 0.001, 0.01, 0.02, 0.02}, 100, 6900);
}

}  // namespace
