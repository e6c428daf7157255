#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers {

/// The device's time: offset and rate of its sync count, fitted to the stamps of its frames by
/// least squares over the last 64 that are looked at: every one, or where they come faster one each
/// 20 ms, so that a machine that is busy for some milliseconds is the same at any rate. Stamps that
/// it or a bus delayed stand out of the fit and do not move it. One thread, no allocation.
class SyncClock {
  public:
    explicit SyncClock(Time nominal_period) noexcept;

    /// Counts come in ascending order; one that does not is ignored. True: the stamps have stepped
    /// away for good (kStepStamps that are looked at in a row, by more than kStepSpacings, on one
    /// line), and the fit begins anew.
    bool observe(std::int64_t count, Time stamp) noexcept;
    /// Whole microseconds; before the first observation 0.
    [[nodiscard]] Time time_of(std::int64_t count) const noexcept;
    /// Forgets everything but the nominal period: the device has started anew.
    void reset() noexcept;

  private:
    static constexpr std::size_t kWindow = 64;
    static constexpr double kStepSpacings = 5;
    static constexpr int kStepStamps = 4;
    struct Point {
        std::int64_t count = 0;
        Time stamp = 0;
    };

    void insert(Point point) noexcept;
    void fit() noexcept;

    double nominal_;        ///< ns
    std::int64_t every_;    ///< counts from one that is looked at to the next
    std::int64_t due_ = 0;  ///< the next one
    std::array<Point, kWindow> points_{};
    std::size_t size_ = 0;
    std::size_t next_ = 0;
    Point anchor_;       ///< origin of the fit: the newest point
    double offset_ = 0;  ///< of the line at the anchor's count, ns after the anchor's stamp
    double slope_ = 0;   ///< period minus nominal, ns
    Point suspect_;      ///< the first of the last stamps that are far off, all as far
    int suspects_ = 0;
};

}  // namespace vibrig::drivers
