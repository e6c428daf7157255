#include "estimator/allan/noise_terms.hpp"

#include <numbers>

namespace vibrig::estimator::allan {

double term_variance(Term term, double tau) {
    switch (term) {
        case Term::Q:
            return 3 / (tau * tau);
        case Term::N:
            return 3600 / tau;
        case Term::B:
            return 2 * std::numbers::ln2 / std::numbers::pi;
        case Term::K:
            return tau / (3 * 3600.0);
        case Term::R:
            return tau * tau / (2 * 3600.0 * 3600.0);
    }
    return 0;
}

double model_variance(const Terms& terms, double tau) {
    double sum = 0;
    for (std::size_t j = 0; j < kTerms; ++j) {
        sum += terms[j] * terms[j] * term_variance(static_cast<Term>(j), tau);
    }
    return sum;
}

Alpha dominant_noise(const Terms& terms, double tau) {
    // A ramp is not noise: what it covers is judged as random walk.
    constexpr std::array<Alpha, kTerms> kAlpha{2, 0, -1, -2, -2};
    std::size_t most = 1;
    double largest = 0;
    for (std::size_t j = 0; j < kTerms; ++j) {
        const double part = terms[j] * terms[j] * term_variance(static_cast<Term>(j), tau);
        if (part > largest) {
            largest = part;
            most = j;
        }
    }
    return kAlpha[most];
}

}  // namespace vibrig::estimator::allan
