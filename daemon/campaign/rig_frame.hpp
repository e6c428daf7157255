#pragma once

#include <array>

#include "estimator/filter/settings.hpp"

namespace vibrig::campaign {

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;  ///< rows

/// The rig's frames as the stages with the table at rest need them: encoder angles in, directions
/// out.
class RigFrame {
  public:
    explicit RigFrame(const estimator::Settings& settings);

    /// The vertical in platform axes at these encoder angles.
    [[nodiscard]] Vector up(const Vector& encoder_rad) const;
    [[nodiscard]] Vector up_at_deg(const Vector& encoder_deg) const;
    /// The rig's north and east axes in platform axes at these encoder angles.
    [[nodiscard]] std::array<Vector, 2> north_east_at_deg(const Vector& encoder_deg) const;
    /// Azimuth from true east, positive about up, rad, of the platform axis after the `upright`
    /// one: of x where z is upright.
    [[nodiscard]] double azimuth(const Vector& encoder_rad, int upright = 2) const;
    /// Encoder angles with the azimuth axis vertical, platform z up or down, and this turn of the
    /// azimuth gimbal. Throws estimator::SettingsError where the gimbals cannot do that.
    [[nodiscard]] Vector azimuth_vertical_deg(double azimuth_deg, bool down) const;
    /// The same with the inner gimbal's axis vertical, platform y up or down.
    [[nodiscard]] Vector inner_vertical_deg(double inner_deg, bool down) const;

    /// Raw specific force to platform axes, the configuration's zeros taken off in proportion to
    /// `one` (1 for a force in g).
    [[nodiscard]] Vector force(const Vector& raw, double one) const;
    /// A zero in platform axes as the raw readings show it.
    [[nodiscard]] Vector to_raw(const Vector& platform) const;

  private:
    estimator::Settings settings_;
    Matrix inverse_{};
};

[[nodiscard]] constexpr double dot(const Vector& a, const Vector& b) noexcept {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
[[nodiscard]] constexpr Vector cross(const Vector& a, const Vector& b) noexcept {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// v' P v.
[[nodiscard]] constexpr double quadratic(const Matrix& p, const Vector& v) noexcept {
    return dot(v, {dot(p[0], v), dot(p[1], v), dot(p[2], v)});
}

}  // namespace vibrig::campaign
