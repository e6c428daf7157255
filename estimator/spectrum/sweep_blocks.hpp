#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/spectrum/sweep.hpp"

namespace vibrig::estimator::spectrum {

/// No harmonic of a block's frequencies falls so near a multiple of the samples' rate that its
/// second moment is wrong. All in Hz.
[[nodiscard]] bool clear_of_samples(double from_hz, double to_hz, double sample_hz) noexcept;

/// Makes the blocks of a sweep from its samples, one after the other.
class SweepBlocks {
  public:
    static constexpr double kBlock_s = 1;
    SweepBlocks(const Settings& settings, int run, int position);

    /// Times rise; `hz`: of the vibration at this moment, as the controller reports it.
    void add(const Measurement& measurement, double hz);
    /// The sweep of all samples so far; the last second is there if it is a whole one.
    [[nodiscard]] Sweep finish();
    /// Share of the vibration's power that goes through the frequencies reported, median of the
    /// blocks that shook; 1: of none. A frequency that is wrong by half a hertz, or late by half a
    /// second, leaves less than kShown.
    [[nodiscard]] double shown() const;
    /// The same of each of them.
    [[nodiscard]] const std::vector<double>& shares() const noexcept { return shares_; }
    static constexpr double kShown = 0.9;

  private:
    struct Sample {
        double time_s = 0, hz = 0;
        std::array<double, 3> force{};  ///< platform axes, g
        bool force_good = false;
    };
    void end_block();
    void take_moment(SweepBlock& block);

    const Settings settings_;
    Sweep sweep_;
    std::vector<Sample> samples_;  ///< of the block
    std::vector<double> shares_;
    std::array<double, 3> first_{}, sum_{};  ///< of the angles
    double begin_s_ = 0;                     ///< of the block
    std::size_t angles_ = 0;
    bool begun_ = false;
};

}  // namespace vibrig::estimator::spectrum
