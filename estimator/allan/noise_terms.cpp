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

}  // namespace vibrig::estimator::allan
