#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "daemon/rt/ring.hpp"
#include "drivers/base/clock.hpp"
#include "estimator/filter/measurement.hpp"

namespace vibrig::rt {

/// Estimator to control: mean of the encoder angles over one block of a dwell.
struct BlockRecord {
    estimator::DwellInfo dwell;
    double block_s = 1;
    std::uint32_t number = 0;  ///< of the block in the dwell
    std::uint32_t samples = 0;
    double time_s = 0;  ///< mean, from the beginning of the dwell
    std::array<double, 3> angle_rad{};
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};

/// Averages the angles that the filter used, block by block, about a hundred blocks to a dwell:
/// sample by sample the resolvers hide what the gyros do. Estimator thread; neither waits nor
/// allocates.
class AngleBlocks {
  public:
    explicit AngleBlocks(Ring<BlockRecord>& to) : to_(to) {}

    /// `length`: of the dwell as it was ordered.
    void begin(const estimator::DwellInfo& dwell, drivers::Time length) noexcept {
        open_ = {};
        open_.dwell = dwell;
        constexpr double kBlocks = 100, kShortest_s = 1, kLongest_s = 60;
        open_.block_s = std::clamp(drivers::to_seconds(length) / kBlocks, kShortest_s, kLongest_s);
    }

    void add(double time_s, const std::array<double, 3>& angle_rad) noexcept {
        const auto number = static_cast<std::uint32_t>(std::max(0.0, time_s / open_.block_s));
        if (number != open_.number) end();
        if (open_.samples == 0) {
            open_.number = number;
            first_ = angle_rad;
        }
        ++open_.samples;
        open_.time_s += time_s;
        // Next to the first one: an angle may pass through zero.
        for (std::size_t k = 0; k < 3; ++k) {
            open_.angle_rad[k] += std::remainder(angle_rad[k] - first_[k], 2 * std::numbers::pi);
        }
    }

    void end() noexcept {
        if (open_.samples == 0) return;
        BlockRecord done = open_;
        const double n = done.samples;
        done.time_s /= n;
        for (std::size_t k = 0; k < 3; ++k) done.angle_rad[k] = first_[k] + done.angle_rad[k] / n;
        to_.try_push(done);
        open_.samples = 0;
        open_.time_s = 0;
        open_.angle_rad = {};
    }

  private:
    Ring<BlockRecord>& to_;
    BlockRecord open_;  ///< sums so far
    std::array<double, 3> first_{};
};

}  // namespace vibrig::rt
