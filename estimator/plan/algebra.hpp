#pragma once

#include <Eigen/Core>

#include "estimator/plan/model.hpp"

// Inside the room only.
namespace vibrig::estimator::plan {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

[[nodiscard]] inline Eigen::Index at(std::size_t i) { return static_cast<Eigen::Index>(i); }

/// Numbers of the model's coefficients among the ten.
[[nodiscard]] std::vector<std::size_t> active(const Terms& terms);
/// One row per point, the model's coefficients only, divided by the noise.
[[nodiscard]] Matrix rows(const std::vector<Point>& points, const Terms& terms);
/// The same, each column divided by its root mean square (returned in `scale`, 1 for a column of
/// zeros): information matrices of squares and constants differ by orders of magnitude.
[[nodiscard]] Matrix scaled_rows(const Problem& problem, Vector& scale);

}  // namespace vibrig::estimator::plan
