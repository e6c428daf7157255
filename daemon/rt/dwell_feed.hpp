#pragma once

#include "daemon/rt/angle_blocks.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::rt {

/// The measurements of a dwell into the filter, and the means of the angles that it used: the same
/// steps live, where a sample comes now and then, and for a dwell that is fed again. Neither waits
/// nor allocates.
class DwellFeed {
  public:
    DwellFeed(estimator::Identification& to, Ring<BlockRecord>& blocks)
        : identification_(to), averager_(blocks) {}

    [[nodiscard]] bool begun() const noexcept { return begun_; }
    /// `length`: as it was ordered.
    void begin(const estimator::DwellInfo& dwell, drivers::Time length) noexcept {
        identification_.begin_dwell(dwell);
        averager_.begin(dwell, length);
        begun_ = true;
    }
    void add(const estimator::Measurement& measurement) noexcept {
        if (identification_.add(measurement).outcome == estimator::StepOutcome::used)
            averager_.add(measurement.time_s, measurement.angle_rad);
    }
    [[nodiscard]] estimator::DwellSummary end(bool cut_short) noexcept {
        const auto summary = identification_.end_dwell(cut_short);
        averager_.end();
        begun_ = false;
        return summary;
    }
    /// Summary of a dwell without a sample, which the filter never gets.
    [[nodiscard]] estimator::DwellSummary none_of(
        const estimator::DwellInfo& dwell) const noexcept {
        estimator::DwellSummary summary;
        summary.run = dwell.run;
        summary.position = dwell.position;
        summary.flagged = summary.left_out = true;
        summary.reason = "no samples";
        summary.noise = identification_.noise();
        return summary;
    }

  private:
    estimator::Identification& identification_;
    AngleBlocks averager_;
    bool begun_ = false;
};

}  // namespace vibrig::rt
