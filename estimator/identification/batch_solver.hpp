#pragma once

#include <Eigen/Core>

#include "estimator/filter/drift_filter.hpp"
#include "estimator/identification/two_step.hpp"

namespace vibrig::estimator {

/// Generalised least squares over the readings the filter takes, by a way of its own: along the
/// measured angles the model is linear in the coefficients, so the regressors are integrated,
/// whitened against gyro and encoder noise and summed to normal equations. No linearisation about
/// an estimate, no recursion over the coefficients. Its sums do not grow with the data; neither
/// allocates nor throws.
class BatchSolver {
  public:
    /// A coefficient with a prior sigma of 0 stays 0.
    BatchSolver(const Settings& settings, const ParameterArray& prior);

    void begin_dwell() noexcept;
    /// The angles start afresh, as at the first reading of a dwell.
    void start(double time_s, const Eigen::Vector3d& angles_rad) noexcept;
    /// One reading; those that are not `used` only pass the time.
    void step(double time_s, const Eigen::Vector3d& angles_rad, double kappa, bool used) noexcept;
    void end_dwell(bool keep) noexcept;

    /// Over the dwells kept, filter order; false if the sums are not finite.
    [[nodiscard]] bool solve(ParameterArray& value, Covariance& covariance) const noexcept;

  private:
    static constexpr Eigen::Index kColumns = static_cast<Eigen::Index>(kParameters) + 1;
    static constexpr Eigen::Index kReadingsPerBlock = 8;
    using Columns = Eigen::Matrix<double, 3, kColumns>;
    using Sums = Eigen::Matrix<double, kColumns, kColumns>;

    void add_block() noexcept;

    Kinematics kinematics_;
    DriftModel model_;
    FilterNoise noise_;
    ParameterArray prior_;
    Eigen::Vector3d path_ = Eigen::Vector3d::Zero();  ///< last used reading, rad
    double time_s_ = 0;
    bool started_ = false;
    /// Integrated regressors and, last, the angles less the Earth's share, arcsec; each less the
    /// local level that random walk and encoder noise leave known.
    Columns difference_ = Columns::Zero();
    Eigen::Matrix3d walked_ = Eigen::Matrix3d::Zero();  ///< variance of that level, arcsec^2
    Eigen::Matrix<double, 3 * kReadingsPerBlock, kColumns> block_;
    Eigen::Index in_block_ = 0;
    Sums of_dwell_ = Sums::Zero(), kept_ = Sums::Zero();
};

}  // namespace vibrig::estimator
