#pragma once

#include <array>
#include <deque>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/spectrum/sweep_blocks.hpp"

namespace vibrig::estimator::spectrum {

/// The blocks of a sweep whose frequency is read now and then, from its samples: between two
/// readings its logarithm goes straight. In whichever order both come, the blocks are the same.
class ReadSweep {
  public:
    ReadSweep(const Settings& settings, int run, int position) : blocks_(settings, run, position) {}

    /// Times rise. `hz` is finite and above 0.
    void frequency(double time_s, double hz);
    /// Times rise. What no reading is after yet waits for one.
    void add(const Measurement& measurement);
    /// The sweep of all samples: those after the last reading have its frequency. None without a
    /// reading.
    [[nodiscard]] Sweep finish();

    /// s since the dwell began, and Hz.
    [[nodiscard]] const std::vector<std::array<double, 2>>& readings() const noexcept {
        return readings_;
    }
    /// As SweepBlocks.
    [[nodiscard]] double shown() const { return blocks_.shown(); }
    [[nodiscard]] const std::vector<double>& shares() const noexcept { return blocks_.shares(); }

  private:
    void take(const Measurement& measurement);

    SweepBlocks blocks_;
    std::vector<std::array<double, 2>> readings_;
    std::size_t at_ = 0;  ///< the reading after the newest sample that was taken
    std::deque<Measurement> waiting_;
};

}  // namespace vibrig::estimator::spectrum
