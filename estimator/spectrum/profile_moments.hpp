#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/spectrum/profile.hpp"

namespace vibrig::estimator::spectrum {

/// The second moment of each of the profile's bands_of(), level frame, g^2.
[[nodiscard]] std::vector<Eigen::Matrix3d> moments_of(const Profile& profile, int per_decade = 800);

}  // namespace vibrig::estimator::spectrum
