#include "estimator/levelling/design.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/levelling/refusal.hpp"

namespace vibrig::estimator::levelling {
namespace {

double envelope(double x) noexcept { return std::exp(-x) * (1 + x + x * x); }

/// Where the falling function f comes down to the value, between two points.
template <typename Function>
double crossing(Function f, double above, double below, double value) noexcept {
    for (int i = 0; i < 80; ++i) {
        const double middle = 0.5 * (above + below);
        (f(middle) > value ? above : below) = middle;
    }
    return below;
}

}  // namespace

double initial_response(double x, double damping) noexcept {
    // Eq. 15 with the half angle: nothing cancels where xi is near 1.
    const double c = std::sqrt(1 - damping * damping) / damping;
    const double sine = c * x < 1e-8 ? x : std::sin(c * x) / c;
    const double half = c * x < 1e-8 ? x : 2 * std::sin(0.5 * c * x) / c;
    return std::exp(-x) * (std::cos(c * x) + sine - half * half);
}

double settling_product(double residual, double damping) {
    require(damping > 0 && damping < 1, "damping ratio xi", damping, "between 0 and 1");
    require(residual > 0 && residual < 1, "residual fraction", residual, "between 0 and 1");
    double far = 1;
    while (envelope(far) > residual) {
        far *= 1.5;
    }
    const double c = std::sqrt(1 - damping * damping) / damping;
    constexpr double kFastest = 1e3;  // beyond it the envelope is the response
    if (c > kFastest) {
        return crossing(envelope, 0.0, far, residual);
    }
    const auto size = [&](double x) { return std::abs(initial_response(x, damping)); };
    const double step = 0.01 / std::max(1.0, c);
    double x = far;
    while (x > step && size(x - step) <= residual) {
        x -= step;
    }
    return crossing(size, std::max(x - step, 0.0), x, residual);
}

Gains gains_of(double sigma, double damping, const Earth& earth) {
    const double ws2 = earth.schuler_squared();
    const double wn2 = sigma * sigma / (damping * damping);
    return {3 * sigma, (2 * sigma * sigma + wn2) / ws2 - 1, sigma * wn2 / ws2};
}

Design design(const Specification& specification, const Earth& earth) {
    require(std::isfinite(specification.settling_s) && specification.settling_s > 0,
            "settling time", specification.settling_s, "s, more than 0");
    require(std::isfinite(earth.gravity_mps2) && earth.gravity_mps2 > 0, "gravity",
            earth.gravity_mps2, "m/s^2, more than 0");
    Design result;
    result.x = settling_product(specification.residual, specification.damping);
    result.sigma = result.x / specification.settling_s;
    result.gains = gains_of(result.sigma, specification.damping, earth);
    return result;
}

void check_stable(const Gains& gains) {
    require(std::isfinite(gains.k1) && gains.k1 > 0, "K1", gains.k1, "K1 > 0 (Routh)");
    require(std::isfinite(gains.k3) && gains.k3 > 0, "K3", gains.k3, "K3 > 0 (Routh)");
    const double product = gains.k1 * (1 + gains.k2);
    if (!(product > gains.k3) || !std::isfinite(product)) {
        throw DesignError(
            text("gains are unstable (Routh): K1 (1 + K2) > K3 is violated, %g is "
                 "not above %g; K2 must be above %g",
                 product, gains.k3, gains.k3 / gains.k1 - 1));
    }
}

std::array<std::complex<double>, 3> roots(const Gains& gains, const Earth& earth) {
    const double a = gains.k1;
    const double b = (1 + gains.k2) * earth.schuler_squared();
    const double c = gains.k3 * earth.schuler_squared();
    const auto cubic = [&](double s) { return ((s + a) * s + b) * s + c; };
    double reach = 1 + std::abs(a) + std::abs(b) + std::abs(c);  // Cauchy's bound
    double low = -reach;
    double high = reach;
    for (int i = 0; i < 200; ++i) {
        const double middle = 0.5 * (low + high);
        (cubic(middle) < 0 ? low : high) = middle;
    }
    const double real = 0.5 * (low + high);
    // s^2 + (a + real) s + q is left.
    const double p = 0.5 * (a + real);
    const double q = b + real * (a + real);
    const std::complex<double> wd = std::sqrt(std::complex<double>(p * p - q));
    return {real, -p - wd, -p + wd};
}

void check_period(double period_s, double sigma, double settling_s) {
    require(std::isfinite(period_s) && period_s > 0, "sample period", period_s, "s, more than 0");
    if (sigma * period_s > kMostStep) {
        throw DesignError(
            text("sample period %.3g s is too long for a %.3g s levelling: at most %.2g s",
                 period_s, settling_s, at_most(kMostStep / sigma, 2)));
    }
}

double steady_tilt(const Gains& gains, double drift, double zero, const Earth& earth) noexcept {
    const double of_zero = -zero / earth.gravity_mps2;
    if (gains.k3 > 0) {
        return of_zero;
    }
    return gains.k1 * drift / ((1 + gains.k2) * earth.schuler_squared()) + of_zero;
}

}  // namespace vibrig::estimator::levelling
