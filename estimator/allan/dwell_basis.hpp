#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

namespace vibrig::estimator::allan {

/// What noise does to the block means of an angle in one dwell, in contrasts that are free of the
/// angle's offset and rate: white noise stays white, angle random walk becomes diagonal. For blocks
/// of unit length; the caller scales by powers of the block.
class DwellBasis {
  public:
    static constexpr std::size_t kFewestBlocks = 9;

    /// Numbers of the blocks that are present, growing; at least kFewestBlocks of them.
    explicit DwellBasis(std::vector<std::size_t> present);

    [[nodiscard]] const std::vector<std::size_t>& present() const { return present_; }
    [[nodiscard]] Eigen::VectorXd contrasts(const std::vector<double>& angle) const;

    /// Variances of the contrasts for a random walk of unit variance per unit time.
    Eigen::VectorXd walk;
    /// Their covariances for unit B, K, R: times block^2, block^3, block^4.
    std::array<Eigen::MatrixXd, 3> slow;
    std::array<Eigen::MatrixXd, 3> slow_squares;  ///< element by element

    /// Second differences of averages of m blocks: the numerator of MDEV. Sums of their squares are
    /// expected to be white * trace + walk * block * trace; edf = trace(S)^2 / |S|^2.
    struct Octave {
        std::size_t m = 1;
        Eigen::MatrixXd differences;             ///< one row each, on the blocks present
        double white_trace = 0, walk_trace = 0;  ///< of their covariances
        double white_square = 0, product = 0, walk_square = 0;  ///< inner products of those
    };
    std::vector<Octave> octaves;  ///< m up to a quarter of the dwell

  private:
    void add_octaves(const Eigen::MatrixXd& walk_covariance);

    std::vector<std::size_t> present_;
    Eigen::MatrixXd basis_;  ///< orthonormal columns
};

}  // namespace vibrig::estimator::allan
