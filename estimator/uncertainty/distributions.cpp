#include "estimator/uncertainty/distributions.hpp"

#include <unsupported/Eigen/SpecialFunctions>

#include "estimator/allan/edf.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

/// Above so many degrees of freedom a distribution is its limit.
constexpr double kMany = 1e6;

}  // namespace

double chi_square_tail(double x, double dof) {
    return x <= 0 ? 1 : Eigen::numext::igammac(dof / 2, x / 2);
}

double f_tail(double x, double first, double second) {
    if (!(second < kMany)) return chi_square_tail(first * x, first);
    if (x <= 0) return 1;
    return Eigen::numext::betainc(second / 2, first / 2, second / (second + first * x));
}

double student_quantile(double coverage, double dof) {
    const double normal = allan::normal_quantile(0.5 + 0.5 * coverage);
    if (!(dof < kMany)) return normal;
    double low = 0, high = 1;
    const auto outside = [dof](double t) {
        return Eigen::numext::betainc(dof / 2, 0.5, dof / (dof + t * t));
    };
    while (outside(high) > 1 - coverage) high *= 2;
    for (int i = 0; i < 200 && high - low > 1e-13 * high; ++i) {
        const double middle = 0.5 * (low + high);
        (outside(middle) > 1 - coverage ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

}  // namespace vibrig::estimator::uncertainty
