#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/allan/deviation.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::allan {

std::vector<std::size_t> octave_factors(std::size_t largest) {
    std::vector<std::size_t> factors;
    for (std::size_t m = 1; m <= largest; m *= 2) {
        factors.push_back(m);
    }
    return factors;
}

std::vector<std::size_t> decade_factors(std::size_t largest) {
    std::vector<std::size_t> factors;
    for (std::size_t decade = 1; decade <= largest; decade *= 10) {
        for (const std::size_t step : {1U, 2U, 4U}) {
            if (step * decade <= largest) {
                factors.push_back(step * decade);
            }
        }
    }
    return factors;
}

std::vector<std::size_t> all_factors(std::size_t largest) {
    std::vector<std::size_t> factors(largest);
    std::iota(factors.begin(), factors.end(), std::size_t{1});
    return factors;
}

std::vector<std::size_t> log_factors(std::size_t largest, std::size_t count) {
    std::vector<std::size_t> factors;
    for (std::size_t i = 0; i < count && largest > 0; ++i) {
        const double part = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0;
        const auto m =
            static_cast<std::size_t>(std::llround(std::pow(static_cast<double>(largest), part)));
        if (factors.empty() || m > factors.back()) {
            factors.push_back(m);
        }
    }
    return factors;
}

std::vector<std::size_t> factors_of(std::span<const double> taus, double tau0,
                                    std::size_t largest) {
    std::vector<std::size_t> factors;
    for (const double tau : taus) {
        const double ratio = tau / tau0;
        const double m = std::round(ratio);
        if (!(ratio > 0) || std::abs(ratio - m) > 1e-6 * m)
            throw DataError(
                text("--taus: %g s found, expected a multiple of tau0 = %g s", tau, tau0));
        if (m > static_cast<double>(largest))
            throw DataError(text("--taus: %g s found, the record allows at most %g s", tau,
                                 static_cast<double>(largest) * tau0));
        factors.push_back(static_cast<std::size_t>(m));
        if (std::count(factors.begin(), factors.end(), factors.back()) > 1)
            throw DataError(text("--taus: %g s found twice, expected each once", tau));
    }
    return factors;
}

}  // namespace vibrig::estimator::allan
