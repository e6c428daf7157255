#pragma once

#include <array>
#include <span>

#include "tests/plant/isolator.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// Gyros whose mass yields under vibration: each has a mass on a spring, moved by what shakes it
/// and integrated in time.
class Elasticity {
  public:
    explicit Elasticity(const Truth& truth) noexcept;

    [[nodiscard]] bool any() const noexcept { return any_; }
    /// What the second moments of the vibration are larger by for the elastic part of a gyro, over
    /// an interval with the shakes at equal steps: mean of shake times (yield less shake).
    struct Excess {
        double pp = 0, pq = 0, qq = 0;  ///< in phase, mixed, quadrature
    };
    [[nodiscard]] std::array<Excess, 3> advance(double dt_s,
                                                std::span<const Shake> shakes) noexcept;
    /// Part of the quadratic coefficients that is elastic.
    [[nodiscard]] double share(std::size_t gyro) const noexcept { return share_[gyro]; }

  private:
    /// Yield and its rate, of the mass under what is in phase and what is a quarter ahead.
    struct Mass {
        std::array<double, 2> in_phase{}, quadrature{};
    };
    /// One step of Runge and Kutta's method: linear in what it begins with.
    struct Step {
        std::array<std::array<double, 2>, 2> transition{};
        std::array<double, 2> begin{}, middle{}, end{};  ///< by the force there
    };
    void prepare(double step_s) noexcept;

    bool any_ = false;
    Vec3 share_, hz_, damping_;
    std::array<Mass, 3> mass_{};
    std::array<Step, 3> step_{};
    double step_s_ = 0;
};

}  // namespace vibrig::plant
