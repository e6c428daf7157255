#include "estimator/allan/synthetic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace vibrig::estimator::allan {

void add_gauss_markov(std::vector<double>& rate, double tau0, double s, double tm,
                      std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    const double h = tau0 / tm;
    const double keep = std::exp(-h);
    const double lost = -std::expm1(-h);
    // State at the end of a step and mean over it are drawn together, exactly. The mean's variance
    // loses its digits for slow processes: first terms of its series.
    const double end_variance = s * s * -std::expm1(-2 * h);
    const double mean_variance =
        s * s * (h < 1e-3 ? h * (2.0 / 3 - h / 2) : (2 * h - 2 * lost - lost * lost) / (h * h));
    const double covariance = s * s * lost * lost / h;
    const double end_sigma = std::sqrt(end_variance);
    const double common = covariance / end_sigma;
    const double own = std::sqrt(std::max(0.0, mean_variance - common * common));
    double x = s * normal(generator);
    for (double& y : rate) {
        const double drive = normal(generator);
        y += x * lost / h + common * drive + own * normal(generator);
        x = keep * x + end_sigma * drive;
    }
}

std::vector<double> synthetic_rate(const Terms& terms, std::size_t n, double tau0,
                                   std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    const auto [q, white, flicker, walk, ramp] = terms;
    const double white_sigma = 60 * white / std::sqrt(tau0);
    const double walk_sigma = walk / 60 * std::sqrt(tau0);
    std::vector<double> rate(n);
    double bias = 0;
    double angle = q * normal(generator);
    for (std::size_t i = 0; i < n; ++i) {
        const double next = q * normal(generator);
        const double t = (static_cast<double>(i) + 0.5) * tau0;
        const double step = walk_sigma * normal(generator);
        // The mean of a random walk over a step: half of what it does, and a part of its own.
        const double within = step / 2 + walk_sigma / std::sqrt(12.0) * normal(generator);
        rate[i] = (next - angle) / tau0 + white_sigma * normal(generator) + bias + within +
                  ramp * t / 3600;
        angle = next;
        bias += step;
    }
    // One-sided spectrum B^2 / (pi f) from Lorentzians spaced by ln 2 in time: s^2 = B^2 ln 2 / pi.
    const double s = flicker * std::sqrt(std::numbers::ln2 / std::numbers::pi);
    const double longest = 16 * static_cast<double>(n) * tau0;
    for (double tm = tau0 / 64; flicker > 0 && tm < longest; tm *= 2) {
        add_gauss_markov(rate, tau0, s, tm, generator());
    }
    return rate;
}

}  // namespace vibrig::estimator::allan
