#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace vibrig::estimator::uncertainty {

/// From fewer units nothing is said about others.
inline constexpr std::size_t kFewestUnits = 10;
/// A unit that its type allows less often than this is not taken for one of it.
inline constexpr double kOutsider = 0.01;

/// What one campaign found, and the covariance of what differs from campaign to campaign.
struct Found {
    Eigen::VectorXd value;
    Eigen::MatrixXd covariance;
};

/// Coefficients of a type of units: between units, and between campaigns of one unit.
struct Population {
    std::size_t units = 0, campaigns = 0;
    Eigen::VectorXd mean;
    Eigen::MatrixXd between;  ///< units
    Eigen::MatrixXd within;   ///< campaigns of one unit, beyond what was measured; 0: not known
    /// Covariance of the truth in a campaign of another unit, as wide as so few units leave it.
    Eigen::MatrixXd predicted;
    double independent = 1;  ///< share of the correlations that is not believed, 0 to 1
};

/// By moments, each unit counting once; the correlations shrunk by how little the units tell of
/// them (Schaefer and Strimmer 2005). Throws std::invalid_argument with fewer than kFewestUnits, or
/// where sizes do not fit.
[[nodiscard]] Population population_of(const std::vector<std::vector<Found>>& units);

/// Mahalanobis' distance of a unit from its type.
struct Distance {
    double squared = 0;
    double dof = 0;  ///< of the chi-square that it has after scaling: `squared` has this mean too
    double p = 1;    ///< that a unit of the type is as far or farther
    [[nodiscard]] bool outside() const noexcept { return !(p >= kOutsider); }
};
[[nodiscard]] Distance distance(const Population& type, const Found& unit);

/// The unit's coefficients as its campaign and its type have them together.
[[nodiscard]] Found with_type(const Population& type, const Found& unit);

}  // namespace vibrig::estimator::uncertainty
