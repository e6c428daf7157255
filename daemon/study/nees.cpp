#include "daemon/study/nees.hpp"

#include <limits>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::study {

double nees(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
    if (covariance.rows() != error.size()) return std::numeric_limits<double>::quiet_NaN();
    return estimator::linear_algebra::squared_distance(covariance, error);
}

}  // namespace vibrig::study
