#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::uncertainty {

/// What the data say of one unknown of a class that is freed.
struct FreedUnknown {
    std::string of_class, element;
    double value = 0, sigma = 0;
    std::string unit;
};

/// Structural misfits as further unknowns, their prior 16 times the size of the class. By block
/// regression: first they, with all that looks like a coefficient left out, then the coefficients
/// from rates without them, and again about what was found. With a constant bias that is the joint
/// least squares.
struct Freed {
    std::vector<FreedUnknown> list;
    std::vector<DwellRow> rows;  ///< without what was found
    Eigen::MatrixXd prior;       ///< 3 n x m, rates of one prior sigma of each
    int determined = 0;          ///< so many of them by the data
    bool settled = false;        ///< one more step moves nothing
    Eigen::MatrixXd z;           ///< 3 n x m, rates of the size of each
    Eigen::MatrixXd gain;        ///< m x 3 n: of the unknowns, in sizes, from the rates
    Eigen::MatrixXd covariance;  ///< m x m, in sizes

    /// What it means for an estimator of the coefficients (30 x 3 n) and its covariance.
    void put_into(Eigen::MatrixXd& of_coefficients, Eigen::MatrixXd& their_covariance) const;
};

/// `coefficients`, from all the rates, and their `prior_information`: 30, filter order.
[[nodiscard]] Freed determine_freed(const Settings& settings, const DwellTable& table,
                                    const ParameterArray& coefficients,
                                    const Eigen::VectorXd& prior_information);

/// What is freed is not declared as well.
[[nodiscard]] Inputs without(Inputs inputs, const std::vector<Misfit>& freed);

}  // namespace vibrig::estimator::uncertainty
