#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "estimator/filter/drift_filter.hpp"
#include "estimator/filter/normal_sums.hpp"
#include "estimator/identification/dwell_row.hpp"
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
    void step(double time_s, const Eigen::Vector3d& angles_rad, const VibrationMoment& vibration,
              bool used) noexcept;
    /// What of a row the sums of the dwell tell: rates, ramps and their regressors; those of the
    /// gyros' own coefficients. False if they do not determine them. Before end_dwell().
    [[nodiscard]] bool row(DwellRow& out) noexcept;
    /// `walked`: variance of what the biases moved by since the dwell kept before, (deg/h)^2.
    void end_dwell(bool keep, double walked = 0) noexcept;
    void set_noise(const FilterNoise& noise) noexcept { noise_ = noise; }

    /// Whether the biases stood still, or are those of the last dwell kept after their walk.
    enum class Bias : std::uint8_t { constant, now };
    /// Over the dwells kept, filter order; false if the sums are not finite.
    [[nodiscard]] bool solve(ParameterArray& value, Covariance& covariance,
                             Bias bias = Bias::constant) const noexcept;

  private:
    /// Coefficients, a drift of each gyro that grows along the dwell, the angles.
    static constexpr Eigen::Index kRamps = static_cast<Eigen::Index>(kParameters);
    static constexpr Eigen::Index kColumns = kRamps + 4;
    static constexpr std::size_t kReadingsPerBlock = NormalSums::kRows / 3;
    static_assert(kColumns <= static_cast<Eigen::Index>(NormalSums::kColumns));
    using Sums = Eigen::Matrix<double, kColumns, kColumns>;

    void add_block() noexcept;
    void let_biases_walk(double variance) noexcept;
    [[nodiscard]] Sums of_dwell() const noexcept;

    const NormalSums* kernel_ = &normal_sums();
    Kinematics kinematics_;
    DriftModel model_;
    FilterNoise noise_;
    ParameterArray prior_;
    Eigen::Vector3d path_ = Eigen::Vector3d::Zero();  ///< last used reading, rad
    double time_s_ = 0;
    double first_s_ = 0, last_s_ = 0;  ///< readings of the dwell
    Eigen::Vector3d first_path_ = Eigen::Vector3d::Zero(), path_sum_ = Eigen::Vector3d::Zero();
    std::uint32_t readings_ = 0;  ///< used in the dwell
    bool started_ = false;
    /// Integrated regressors and, last, the angles less the Earth's share, arcsec; each less the
    /// local level that random walk and encoder noise leave known.
    alignas(64) NormalSums::Angles difference_{};
    Eigen::Matrix3d walked_ = Eigen::Matrix3d::Zero();  ///< variance of that level, arcsec^2
    alignas(64) double block_[NormalSums::kRows][NormalSums::kColumns]{};
    std::size_t in_block_ = 0;  ///< readings
    alignas(64) double of_dwell_[NormalSums::kColumns][NormalSums::kColumns]{};
    Sums kept_ = Sums::Zero();
    /// The same, as far as it tells of the biases as they are now.
    Sums kept_now_ = Sums::Zero();
};

}  // namespace vibrig::estimator
