#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "estimator/filter/vibration_moment.hpp"
#include "estimator/level/growing_blocks.hpp"

namespace vibrig::estimator {

/// Second moment of the specific force about its mean, level axes, over all samples given, with
/// Hann weights as GrowingHann has them; only its shape, in which gain, level and leakage cancel.
/// One stretch of a dwell at a time. Never allocates after construction.
class GrowingTensor {
  public:
    void clear() noexcept;
    /// Specific force, g: north, up, east.
    void add(const Eigen::Vector3d& force) noexcept;
    /// The time of a sample that there is not passes.
    void add_missing() noexcept { blocks_.add_missing(); }

    /// Grown enough since the last shape() to be worth another.
    [[nodiscard]] bool due() const noexcept;
    /// Over its vertical part; false, and `out` untouched, without vibration. `noise_g`: of one
    /// accelerometer, 1 sigma.
    [[nodiscard]] bool shape(double noise_g, LevelTensor& out) noexcept;

  private:
    /// 1, three components, six products.
    static constexpr std::size_t kChannels = 10;
    [[nodiscard]] std::array<double, kChannels> sums() const noexcept;

    GrowingBlocks<kChannels, 128> blocks_;
    std::size_t count_at_shape_ = 0;
};

}  // namespace vibrig::estimator
