#pragma once

#include <optional>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/plan/model.hpp"

namespace vibrig::estimator::plan {

// Positions are what the encoders of outer, inner and azimuth gimbal show, in deg; the settings say
// how they count and which platform axis is up.

/// The gimbal angles of a position, in (-180, 180], and the position of gimbal angles.
[[nodiscard]] Vec3 attitude_of(const Settings& settings, const Vec3& position_deg);
[[nodiscard]] Vec3 position_of(const Settings& settings, const Vec3& gimbal_deg);

/// Direction of the vertical in platform axes.
[[nodiscard]] Vec3 up_at(const Settings& settings, const Vec3& position_deg);

/// Faces, edges and corners of the cube: 6 + 12 + 8 unit vectors.
[[nodiscard]] std::vector<Vec3> cube_directions();

/// What the gimbals may do, all in deg; the inner gimbal's angle never exceeds 80 deg. A limit
/// holds for the angle in (-180, 180] as well as for the same angle a turn further.
struct GimbalLimits {
    Vec3 low{-360, -360, -360};
    Vec3 high{360, 360, 360};
    std::vector<Vec3> forbidden;   ///< centres
    double forbidden_within = 10;  ///< largest of the three angle differences

    [[nodiscard]] bool allow(const Vec3& position_deg) const;
};

/// The position with the vertical along `direction`, the inner angle zero if that is possible;
/// nothing if the limits leave none.
[[nodiscard]] std::optional<Vec3> position_for(const Settings& settings, const Vec3& direction,
                                               const GimbalLimits& limits);

/// All combinations of gimbal angles `step_deg` apart within the limits whose verticals differ.
[[nodiscard]] std::vector<Vec3> position_grid(const Settings& settings, double step_deg,
                                              const GimbalLimits& limits);

}  // namespace vibrig::estimator::plan
