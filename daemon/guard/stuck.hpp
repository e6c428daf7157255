#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "drivers/base/clock.hpp"

namespace vibrig::guard {

/// A moment on both clocks: CLOCK_MONOTONIC, and the simulated rig's where it owns the time.
struct Moment {
    drivers::Time wall = 0, rig = 0;
};

/// What has passed on both, s.
[[nodiscard]] double seconds_between(const Moment& from, const Moment& to) noexcept;

/// Whether the noise of one accelerometer at rest is known in this run: it went up and down, by
/// much more than one that is stuck may flicker, in window after window.
class Noise {
  public:
    void add(drivers::Time rig, double raw_g, double count_g, double window_s) noexcept;
    [[nodiscard]] bool known() const noexcept { return known_; }

  private:
    std::optional<drivers::Time> begun_;   ///< the window
    double lowest_g_ = 0, highest_g_ = 0;  ///< in it
    double rise_g_ = 0, fall_g_ = 0;       ///< the largest in it
    int windows_ = 0;
    bool known_ = false;
};

/// Whether an accelerometer, or one of a triad, shows the same although the table shakes: its
/// stillness is then no rest, until it is seen to move. One that has lost the noise that it had at
/// rest shows nothing, whether others say that the table shakes or not. Judged by raw readings and
/// their counts.
class StuckWatch {
  public:
    /// `counts_g`: what one count is; 0 where the bus carries a floating-point number. `window_s`:
    /// what rest is measured over.
    StuckWatch(std::size_t axes, const std::array<double, 3>& counts_g, double window_s)
        : axes_(axes), counts_g_(counts_g), window_s_(window_s) {}
    void add(drivers::Time rig, const std::array<double, 3>& raw_g) noexcept;
    /// The vibration that others measure where this one is, peak. It is along gravity, so that an
    /// axis has to show its share of it.
    void expect(const Moment& now, double peak_g) noexcept;
    [[nodiscard]] bool doubted() const noexcept {
        return doubted_[0] || doubted_[1] || doubted_[2];
    }
    /// One of them has ceased to show its noise: what it shows is old.
    [[nodiscard]] bool frozen() const noexcept;

  private:
    std::size_t axes_;
    std::array<double, 3> counts_g_;
    double window_s_;
    std::array<Noise, 3> noise_;
    std::array<double, 3> shown_g_{};
    drivers::Time newest_ = 0;
    std::array<std::optional<drivers::Time>, 3> since_{};    ///< has not moved, rig's time
    std::array<std::optional<Moment>, 3> expected_since_{};  ///< it should have
    std::array<bool, 3> doubted_{};
};

}  // namespace vibrig::guard
