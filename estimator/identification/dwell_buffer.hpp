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
    DwellBuffer(double span_s, std::size_t capacity);

    void clear() noexcept;
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
    double span_s_;
    std::size_t capacity_;
    double shortest_interval_ = 0;
    std::vector<Reading> readings_;
    std::vector<double> scratch_;
};

}  // namespace vibrig::estimator
