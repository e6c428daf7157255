#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

namespace vibrig::estimator {

// Plain arrays as vectors and, row by row, as matrices: views to compute with.

template <std::size_t N>
[[nodiscard]] auto mapped(const std::array<double, N>& of) {
    return Eigen::Map<const Eigen::Matrix<double, N, 1>>(of.data());
}
template <std::size_t N>
[[nodiscard]] auto mapped(std::array<double, N>& of) {
    return Eigen::Map<Eigen::Matrix<double, N, 1>>(of.data());
}
template <std::size_t M, std::size_t N>
[[nodiscard]] auto mapped(const std::array<std::array<double, N>, M>& of) {
    return Eigen::Map<const Eigen::Matrix<double, M, N, Eigen::RowMajor>>(of.front().data());
}
template <std::size_t M, std::size_t N>
[[nodiscard]] auto mapped(std::array<std::array<double, N>, M>& of) {
    return Eigen::Map<Eigen::Matrix<double, M, N, Eigen::RowMajor>>(of.front().data());
}

}  // namespace vibrig::estimator
