#include "estimator/allan/classical.hpp"

#include <cmath>
#include <limits>

#include "estimator/allan/series.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// sqrt(2 ln2 / pi)
constexpr double kFlickerFloor = 0.664;

double root(double square) { return square >= 0 ? std::sqrt(square) : kNaN; }

/// Range of tau within [shortest, longest] where a class has a negative sum.
void check_class(const char* name, const Polynomial& a, double ClassSums::*member, double shortest,
                 double longest, std::vector<std::string>& notes) {
    constexpr int kSteps = 200;
    double first = 0;
    double last = 0;
    for (int i = 0; i <= kSteps; ++i) {
        const double tau = shortest * std::pow(longest / shortest, i / double{kSteps});
        if (class_sums(a, tau).*member < 0) {
            first = first > 0 ? first : tau;
            last = tau;
        }
    }
    if (last > 0) {
        notes.push_back(
            text("the %s class is negative for tau from %.3g to %.3g s: no sum of damped "
                 "oscillations has this variance there",
                 name, first, last));
    }
}

}  // namespace

double allan_multiplier(int power) { return 2 * (1 - std::pow(2.0, power)); }

ClassSums class_sums(const Polynomial& a, double tau) {
    return {a[0] + tau * (a[1] + tau * a[2]), (a[3] + a[4] / tau) / tau};
}

ClassicalFit fit_classical(std::span<const ClassicalPoint> curve, MeanMode mode) {
    const bool corrected = mode == MeanMode::corrected;
    const std::size_t unknowns = corrected ? 4 : 5;
    if (curve.size() < unknowns) {
        throw DataError("classical fit: a curve of " + std::to_string(curve.size()) +
                        " points found, at least " + std::to_string(unknowns) + " needed");
    }
    const auto rows = static_cast<Eigen::Index>(curve.size());
    const auto columns = static_cast<Eigen::Index>(unknowns);
    Eigen::MatrixXd basis(rows, columns);
    Eigen::VectorXd b(rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
        const ClassicalPoint& point = curve[static_cast<std::size_t>(i)];
        // Averages over tau are as many as fit into the window: relative error ~ sqrt(tau / T).
        const double weight = point.variance > 0 ? 1 / (point.variance * std::sqrt(point.tau)) : 0;
        b[i] = weight * point.variance;
        for (Eigen::Index k = 0; k < columns; ++k) {
            const int power = kPowers[static_cast<std::size_t>(k + (corrected ? 1 : 0))];
            basis(i, k) =
                weight * (corrected ? std::pow(point.tau, power) - std::pow(point.covered, power)
                                    : std::pow(point.tau, power));
        }
    }
    const Eigen::VectorXd scale = basis.colwise().norm().cwiseMax(1e-300);
    basis = basis * scale.cwiseInverse().asDiagonal();
    const Eigen::VectorXd x = linear_algebra::least_squares(basis, b).cwiseQuotient(scale);
    Polynomial a{};
    for (std::size_t k = 0; k < unknowns; ++k) {
        a[k + (corrected ? 1 : 0)] = x[static_cast<Eigen::Index>(k)];
    }
    ClassicalFit fit =
        interpret(a, mode == MeanMode::known_mean, curve.front().tau, curve.back().tau);
    if (mode == MeanMode::window_mean) {
        fit.notes.emplace_back(
            "a0 and B: the window's mean was removed, a0 is not identifiable from such data; the "
            "value is -(a1 T + a2 T^2 + ...)");
        fit.terms[static_cast<std::size_t>(Term::B)] = root(a[0]) / kFlickerFloor;
    }
    return fit;
}

ClassicalFit interpret(const Polynomial& a, bool a0_known, double shortest, double longest) {
    ClassicalFit fit;
    fit.a = a;
    fit.a0_known = a0_known;
    fit.terms = {root(allan_multiplier(-2) * a[4] / 3), root(allan_multiplier(-1) * a[3]) / 60,
                 a0_known ? root(a[0]) / kFlickerFloor : kNaN,
                 root(3 * allan_multiplier(1) * a[1]) * 60,
                 root(2 * allan_multiplier(2) * a[2]) * 3600};
    constexpr std::array<const char*, kTerms> kNegative{
        "Q: negative, not a quantisation term", "N: negative, not white noise", "",
        "K: negative, no rate random walk", "R: negative, no rate ramp"};
    for (std::size_t j = 0; j < kTerms; ++j) {
        if (std::isnan(fit.terms[j]) && *kNegative[j] != '\0') {
            fit.notes.emplace_back(kNegative[j]);
        }
    }
    if (!a0_known) {
        // Without a0 the slow class is known up to a constant only.
        fit.notes.emplace_back(
            "a0 and B: not identifiable with the window's mean removed; give a known mean");
    } else {
        check_class("slow", a, &ClassSums::slow, shortest, longest, fit.notes);
    }
    check_class("fast", a, &ClassSums::fast, shortest, longest, fit.notes);
    return fit;
}

}  // namespace vibrig::estimator::allan
