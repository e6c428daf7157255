#pragma once

#include "tests/plant/isolator.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// What the platform and its base do when the isolators' vibration goes through them: straight up
/// on a good rig, with sideways motion and rocking on a bad one. All of it is in step with the
/// vibration, in phase or a quarter period ahead of it.
class VibrationShape {
  public:
    explicit VibrationShape(const Truth& truth) noexcept;

    /// Of the platform, reference frame, g; gravity not included.
    [[nodiscard]] Vec3 acceleration(const Shake& shake) const noexcept {
        return shake.in_phase * along_ + shake.quadrature * quadrature_;
    }
    /// Small turn of the platform from where its loop holds it on average: platform axes, rad.
    [[nodiscard]] Vec3 platform_turn(const Shake& shake) const noexcept {
        return rocking_ *
               (shake.in_phase * platform_rocking_[0] + shake.quadrature * platform_rocking_[1]);
    }
    /// Small turn of what carries the outer gimbal: reference frame, rad.
    [[nodiscard]] Vec3 base_turn(const Shake& shake) const noexcept {
        return rocking_ * (shake.in_phase * base_rocking_[0] + shake.quadrature * base_rocking_[1]);
    }
    /// Rocking and what goes across, over the truth's, from now on.
    void grow(double rocking, double across) noexcept {
        rocking_ = rocking;
        along_ = straight_ + across * across_;
        quadrature_ = across * across_quadrature_;
    }
    [[nodiscard]] bool platform_rocks() const noexcept { return platform_rocks_; }
    [[nodiscard]] bool base_rocks() const noexcept { return base_rocks_; }

  private:
    Vec3 straight_{}, across_{}, across_quadrature_{};
    Vec3 along_{}, quadrature_{};
    double rocking_ = 1;                                       ///< over the truth's
    std::array<Vec3, 2> platform_rocking_{}, base_rocking_{};  ///< rad/g
    bool platform_rocks_, base_rocks_;
};

}  // namespace vibrig::plant
