#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdio>
#include <string>

#include "estimator/zeros/calibration.hpp"

namespace vibrig::estimator::zeros {

[[nodiscard]] inline Eigen::Vector3d vector(const Triple& t) { return {t[0], t[1], t[2]}; }

[[nodiscard]] inline Eigen::Matrix3d matrix(const std::array<Triple, 3>& rows) {
    Eigen::Matrix3d m;
    for (Eigen::Index i = 0; i < 3; ++i) m.row(i) = vector(rows[static_cast<std::size_t>(i)]);
    return m;
}

/// printf into a string, at most 320 characters.
template <typename... Values>
std::string text(const char* format, Values... values) {
    std::array<char, 320> out{};
    std::snprintf(out.data(), out.size(), format, values...);
    return out.data();
}

}  // namespace vibrig::estimator::zeros
