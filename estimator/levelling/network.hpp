#pragma once

#include "estimator/levelling/design.hpp"

namespace vibrig::estimator::levelling {

/// The fast network of one channel in a form whose command makes no step when k1 or k3 change; one
/// of k2 steps by dk2 w / R. Zero gains: undamped.
class FastNetwork {
  public:
    FastNetwork() = default;
    explicit FastNetwork(const Earth& earth) : radius_m_(earth.radius_m) {}

    /// Begins at the reference velocity: a carrier under way is no tilt.
    void start(double reference) noexcept { v_ = reference; }
    /// One period: specific force (m/s^2) and reference velocity (m/s) in, commanded rate (rad/s)
    /// out. `integrate` false keeps z.
    double step(double force, double reference, const Gains& gains, double period_s,
                bool integrate = true) noexcept;
    /// The command that the drift found so far asks for, without the loop.
    [[nodiscard]] double held(double reference) const noexcept {
        return (reference + z_) / radius_m_;
    }
    /// Undoes the integration of the last step: its command did not reach the torquer.
    void stop_integrator() noexcept { z_ = z_before_; }
    /// From now on with zero gains, without a step in the command.
    void become_undamped(double reference, const Gains& gains) noexcept;

    [[nodiscard]] double w() const noexcept { return w_; }  ///< m/s, velocity - reference
    [[nodiscard]] double z() const noexcept { return z_; }  ///< m/s
    [[nodiscard]] double drift() const noexcept { return z_ / radius_m_; }  ///< rad/s

  private:
    double radius_m_ = Earth{}.radius_m;
    double v_ = 0, w_ = 0, z_ = 0, z_before_ = 0;
};

/// H(s) = (s + 8.5e-4)(s + 9.412e-2) / ((s + 8e-3)(s + 1e-2)), the network in use before.
class ConventionalNetwork {
  public:
    explicit ConventionalNetwork(const Earth& earth) : radius_m_(earth.radius_m) {}
    void start(double reference) noexcept { v_ = reference; }
    double step(double force, double reference, double period_s) noexcept;

  private:
    double radius_m_;
    double v_ = 0, x1_ = 0, x2_ = 0;
};

}  // namespace vibrig::estimator::levelling
