#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers {

/// The device's time: offset and rate of its sync count, fitted to the stamps of its frames by
/// least squares over the last 64 counts. Stamps that a bus or a busy machine delayed stand out of
/// the fit and do not move it. One thread, no allocation.
class SyncClock {
  public:
    explicit SyncClock(Time nominal_period) noexcept;

    /// Counts come in ascending order; one that does not is ignored. True: the stamps have stepped
    /// away for good (kStepStamps in a row by more than kStepPeriods, on one line), and the fit
    /// begins anew.
    bool observe(std::int64_t count, Time stamp) noexcept;
    /// Whole microseconds; before the first observation 0.
    [[nodiscard]] Time time_of(std::int64_t count) const noexcept;
    /// Forgets everything but the nominal period: the device has started anew.
    void reset() noexcept;

  private:
    static constexpr std::size_t kWindow = 64;
    static constexpr double kStepPeriods = 5;
    static constexpr int kStepStamps = 4;
    struct Point {
        std::int64_t count = 0;
        Time stamp = 0;
    };

    void insert(Point point) noexcept;
    void fit() noexcept;

    double nominal_;  ///< ns
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
