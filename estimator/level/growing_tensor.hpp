#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {

/// Second moment of the specific force about its mean, level axes, over all samples given, with
/// Hann weights as GrowingHann has them; only its shape, in which gain, level and leakage cancel.
/// One stretch of a dwell at a time. Never allocates after construction.
class GrowingTensor {
  public:
    GrowingTensor();
    void clear() noexcept;
    /// Specific force, g: north, up, east.
    void add(const Eigen::Vector3d& force) noexcept;
    /// The time of a sample that there is not passes.
    void add_missing() noexcept { advance(); }

    /// Grown enough since the last shape() to be worth another.
    [[nodiscard]] bool due() const noexcept;
    /// Over its vertical part; false, and `out` untouched, without vibration. `noise_g`: of one
    /// accelerometer, 1 sigma.
    [[nodiscard]] bool shape(double noise_g, LevelTensor& out) noexcept;

  private:
    /// 1, three components, six products.
    static constexpr std::size_t kChannels = 10;
    static constexpr std::size_t kBlocks = 128;
    struct Block {
        /// Sums of x, x tau, x tau^2 of each channel, tau from the block's centre.
        std::array<std::array<double, kChannels>, 3> sum{};
    };
    void advance() noexcept;
    void merge() noexcept;
    [[nodiscard]] std::array<double, kChannels> sums() const noexcept;

    std::vector<Block> blocks_;
    std::size_t full_ = 0;      ///< complete blocks
    std::size_t length_ = 1;    ///< samples per block
    std::size_t in_block_ = 0;  ///< samples in the block that grows
    std::size_t count_ = 0, count_at_shape_ = 0;
};

}  // namespace vibrig::estimator
