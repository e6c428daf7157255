#pragma once

#include <Eigen/Core>

namespace vibrig::study {

/// Error squared in units of its covariance; NaN if that is none.
[[nodiscard]] double nees(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance);

}  // namespace vibrig::study
