#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "estimator/filter/settings.hpp"
#include "estimator/spectrum/elastic.hpp"
#include "estimator/spectrum/sweep.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {

/// What one gyro's drift over a sweep says of its coefficients: rates between neighbouring blocks,
/// whitened (docs/theory/spectrum.md, "Sweeps"). Their noise is the gyro's random walk, averaged
/// over the blocks, and the encoders'; what they have in common may be off by `offset_sigma`,
/// deg/h, since a bias that walks must not become a spectrum.
class SweptRates {
  public:
    static constexpr double kFree = 1e3;
    SweptRates(const Settings& settings, const Sweep& sweep, std::size_t gyro,
               double offset_sigma = kFree);

    [[nodiscard]] Eigen::Index size() const noexcept { return rate_.size(); }
    [[nodiscard]] const Eigen::VectorXd& rate() const noexcept { return rate_; }  ///< n
    [[nodiscard]] const Eigen::MatrixXd& base() const noexcept { return base_; }  ///< n x 10
    /// n x 6: what an elastic part adds to the six quadratic columns.
    [[nodiscard]] Eigen::MatrixXd elastic(const Resonance& of) const;

  private:
    struct Seen {
        std::array<double, 2> hz{};
        Eigen::Matrix<double, kElastic, 1> vibration;
    };
    [[nodiscard]] Eigen::MatrixXd whitened(Eigen::MatrixXd rows) const;

    std::vector<Seen> blocks_;         ///< those that are known
    std::vector<std::size_t> before_;  ///< of a rate: the block before it, the next is after it
    Eigen::VectorXd diagonal_,
        below_;               ///< of the covariance's Cholesky factor, n; below_[i]: row i
    Eigen::VectorXd common_;  ///< whitened direction of what they have in common, scaled
    Eigen::VectorXd rate_;
    Eigen::MatrixXd base_;
};

}  // namespace vibrig::estimator::spectrum
