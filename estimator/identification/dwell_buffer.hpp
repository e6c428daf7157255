#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace vibrig::estimator {

/// A measurement in the estimator's axes: signs, zeros and accelerometer matrix applied, quality
/// checked.
struct Reading {
    double time_s = 0;
    Eigen::Vector3d angles = Eigen::Vector3d::Zero();  ///< gimbal angles, rad
    Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< g, platform axes
    bool angles_good = false;
    bool force_good = false;
};

/// The first readings of a dwell, kept until the vibration level is known, and what is learnt from
/// them. Never allocates after construction.
class DwellBuffer {
  public:
    /// Covers `span_s`, or `longest_s` at most where it is told to wait; of samples at `rate_hz` or
    /// less.
    DwellBuffer(double span_s, double longest_s, double rate_hz);

    void clear() noexcept;
    /// Until so much is covered.
    void wait_for(double span_s) noexcept { wanted_s_ = span_s; }
    [[nodiscard]] double waits_for() const noexcept { return wanted_s_; }
    void push(const Reading& reading) noexcept;
    /// The span is covered, or there is no more room.
    [[nodiscard]] bool full() const noexcept;
    [[nodiscard]] bool empty() const noexcept { return readings_.empty(); }
    [[nodiscard]] const std::vector<Reading>& readings() const noexcept { return readings_; }
    [[nodiscard]] const Reading& last() const noexcept { return readings_.back(); }

    /// Median interval, so that lost readings do not stretch it; `otherwise` with fewer than two
    /// readings.
    [[nodiscard]] double period(double otherwise) noexcept;
    /// Median of each angle over the good readings; false if there are none.
    [[nodiscard]] bool median_angles(Eigen::Vector3d& out) noexcept;

  private:
    double span_s_, rate_hz_;
    double wanted_s_ = span_s_;
    double shortest_interval_ = 0;
    std::vector<Reading> readings_;
    std::vector<double> scratch_;
};

}  // namespace vibrig::estimator
