#include "estimator/uncertainty/distributions.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/allan/edf.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

constexpr double kTiny = 1e-300;
constexpr double kPrecision = 1e-15;

/// std::lgamma writes the sign to a variable that all threads share.
double log_gamma(double a) {
    int sign = 0;
    return ::lgamma_r(a, &sign);
}

/// Regularised upper incomplete gamma function: series below a + 1, else Lentz's fraction.
double gamma_upper(double a, double x) {
    if (x <= 0) return 1;
    const double scale = std::exp(-x + a * std::log(x) - log_gamma(a));
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (double n = a + 1; term > kPrecision * sum; ++n) sum += term *= x / n;
        return std::max(0.0, 1 - scale * sum);
    }
    double b = x + 1 - a, c = 1 / kTiny, d = 1 / b, h = d;
    for (int i = 1; i < 10000; ++i) {
        const double an = -i * (i - a);
        b += 2;
        d = an * d + b;
        d = 1 / (std::abs(d) < kTiny ? kTiny : d);
        c = b + an / c;
        if (std::abs(c) < kTiny) c = kTiny;
        h *= d * c;
        if (std::abs(d * c - 1) < kPrecision) break;
    }
    return scale * h;
}

/// Continued fraction of the incomplete beta function, for x < (a + 1) / (a + b + 2).
double beta_fraction(double a, double b, double x) {
    double c = 1, d = 1 - (a + b) * x / (a + 1);
    d = 1 / (std::abs(d) < kTiny ? kTiny : d);
    double h = d;
    for (int m = 1; m < 10000; ++m) {
        const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
        for (const double step : {even, odd}) {
            d = 1 + step * d;
            d = 1 / (std::abs(d) < kTiny ? kTiny : d);
            c = 1 + step / c;
            if (std::abs(c) < kTiny) c = kTiny;
            h *= d * c;
        }
        if (std::abs(d * c - 1) < kPrecision) break;
    }
    return h;
}

/// Regularised incomplete beta function I_x(a, b).
double beta_lower(double a, double b, double x) {
    if (x <= 0) return 0;
    if (x >= 1) return 1;
    const double scale = std::exp(log_gamma(a + b) - log_gamma(a) - log_gamma(b) + a * std::log(x) +
                                  b * std::log1p(-x));
    if (x < (a + 1) / (a + b + 2)) return scale * beta_fraction(a, b, x) / a;
    return 1 - scale * beta_fraction(b, a, 1 - x) / b;
}

/// Above so many degrees of freedom a distribution is its limit.
constexpr double kMany = 1e6;

}  // namespace

double chi_square_tail(double x, double dof) { return gamma_upper(dof / 2, x / 2); }

double f_tail(double x, double first, double second) {
    if (!(second < kMany)) return chi_square_tail(first * x, first);
    return beta_lower(second / 2, first / 2, second / (second + first * x));
}

double student_quantile(double coverage, double dof) {
    const double normal = allan::normal_quantile(0.5 + 0.5 * coverage);
    if (!(dof < kMany)) return normal;
    double low = 0, high = 1;
    const auto outside = [dof](double t) { return beta_lower(dof / 2, 0.5, dof / (dof + t * t)); };
    while (outside(high) > 1 - coverage) high *= 2;
    for (int i = 0; i < 200 && high - low > 1e-13 * high; ++i) {
        const double middle = 0.5 * (low + high);
        (outside(middle) > 1 - coverage ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

}  // namespace vibrig::estimator::uncertainty
