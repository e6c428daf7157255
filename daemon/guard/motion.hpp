#pragma once

#include <array>
#include <cstddef>
#include <deque>

namespace vibrig::guard {

/// What one accelerometer, or a triad of them, shows of motion within the last window.
struct Motion {
    bool known = false;  ///< enough samples, none of them old
    /// rms of the norm of the specific force less its mean, g: a slow tilt is no vibration.
    double rest_g = 0;
    /// sqrt 2 times the rms of the vector about a straight line, g: the peak of a sine. A slew's
    /// turning of gravity is nearly one.
    double peak_g = 0;
};

/// Simple and without memory beyond its window; frequency and phase play no part.
class MotionWindow {
  public:
    /// Axes: 1 or 3; those that are not there stay 0.
    MotionWindow(double window_s, std::size_t axes) : window_s_(window_s), axes_(axes) {}
    /// Not finite: left out. Time that goes back begins anew.
    void add(double time_s, const std::array<double, 3>& force_g);
    [[nodiscard]] Motion at(double now_s) const;

  private:
    struct Point {
        double time_s;
        std::array<double, 3> force_g;
    };
    static constexpr std::size_t kLeast = 8;

    double window_s_;
    std::size_t axes_;
    std::deque<Point> points_;
};

}  // namespace vibrig::guard
