#include "estimator/allan/synthetic.hpp"

#include <cmath>
#include <numbers>
#include <random>

namespace vibrig::estimator::allan {

void add_gauss_markov(std::vector<double>& rate, double tau0, double s, double tm,
                      std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    const double keep = std::exp(-tau0 / tm);
    const double drive = s * std::sqrt(-std::expm1(-2 * tau0 / tm));
    double x = s * normal(generator);
    for (double& y : rate) {
        y += x;
        x = keep * x + drive * normal(generator);
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
        rate[i] = (next - angle) / tau0 + white_sigma * normal(generator) + bias + ramp * t / 3600;
        angle = next;
        bias += walk_sigma * normal(generator);
    }
    // One-sided spectrum B^2 / (pi f) from Lorentzians spaced by ln 2 in time: s^2 = B^2 ln 2 / pi.
    const double s = flicker * std::sqrt(std::numbers::ln2 / std::numbers::pi);
    const double longest = 16 * static_cast<double>(n) * tau0;
    for (double tm = tau0 / 4; flicker > 0 && tm < longest; tm *= 2) {
        // Processes much faster than tau0 average down within a sample.
        const double averaged =
            s * std::sqrt(2 * tm / tau0 * (1 - tm / tau0 * -std::expm1(-tau0 / tm)));
        add_gauss_markov(rate, tau0, averaged, tm, generator());
    }
    return rate;
}

}  // namespace vibrig::estimator::allan
