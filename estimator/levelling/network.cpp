#include "estimator/levelling/network.hpp"

namespace vibrig::estimator::levelling {

double FastNetwork::step(double force, double reference, const Gains& gains, double period_s,
                         bool integrate) noexcept {
    // Implicit in the stiff term: stable at any k1 T.
    v_ = (v_ + period_s * (force + gains.k1 * reference)) / (1 + gains.k1 * period_s);
    w_ = v_ - reference;
    z_before_ = z_;
    if (integrate) {
        z_ += period_s * gains.k3 * w_;
    }
    return (reference + (1 + gains.k2) * w_ + z_) / radius_m_;
}

void FastNetwork::become_undamped(double reference, const Gains& gains) noexcept {
    v_ = reference + (1 + gains.k2) * w_;
    w_ = v_ - reference;
}

double ConventionalNetwork::step(double force, double reference, double period_s) noexcept {
    constexpr double kB1 = 8.5e-4 + 9.412e-2;
    constexpr double kB0 = 8.5e-4 * 9.412e-2;
    constexpr double kA1 = 8.0e-3 + 1.0e-2;
    constexpr double kA0 = 8.0e-3 * 1.0e-2;
    const double t = period_s;
    v_ += t * force;
    const double e = v_ - reference;
    // x1' = x2, x2' = e - a1 x2 - a0 x1, implicit.
    x2_ = (x2_ + t * (e - kA0 * x1_)) / (1 + kA1 * t + kA0 * t * t);
    x1_ += t * x2_;
    const double he = e + (kB1 - kA1) * x2_ + (kB0 - kA0) * x1_;
    return (reference + he) / radius_m_;
}

}  // namespace vibrig::estimator::levelling
