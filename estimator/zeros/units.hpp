#pragma once

#include <Eigen/Core>
#include <array>

#include "estimator/filter/text.hpp"
#include "estimator/zeros/calibration.hpp"

namespace vibrig::estimator::zeros {

[[nodiscard]] inline Eigen::Vector3d vector(const Triple& t) { return {t[0], t[1], t[2]}; }

[[nodiscard]] inline Eigen::Matrix3d matrix(const std::array<Triple, 3>& rows) {
    Eigen::Matrix3d m;
    for (Eigen::Index i = 0; i < 3; ++i) m.row(i) = vector(rows[static_cast<std::size_t>(i)]);
    return m;
}

}  // namespace vibrig::estimator::zeros
