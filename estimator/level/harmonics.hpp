#pragma once

#include <array>
#include <cstddef>

namespace vibrig::estimator {

/// How much of a sine's mean square is of its second to fifth harmonics: powers at them, of Hann
/// windows of a second each, which a frequency 0.05 Hz off its command changes by 1 % (of the
/// fifth 8 %). Harmonics below 0.45 of the sampling rate are reported; others alias onto one
/// another. Never allocates.
class Harmonics {
  public:
    static constexpr std::size_t kReported = 4;
    /// Shares of the whole: 2 f .. 5 f; 0: less than 1e-4, or not reported.
    using Shares = std::array<double, kReported>;

    /// A dwell at this frequency begins; `period_s` of the readings, 0: not known yet.
    void begin(double hz, double period_s) noexcept;
    /// Along the vertical, g; time from the beginning of the dwell, that does not fall.
    void add(double time_s, double force_g) noexcept;
    /// Shares over the windows that are nearly whole, by the period.
    [[nodiscard]] Shares shares(double period_s) const noexcept;

  private:
    void close() noexcept;
    [[nodiscard]] std::size_t reported(double period_s) const noexcept;

    double hz_ = 0;
    std::size_t lines_ = 0;  ///< the fundamental, and harmonics
    double window_ = -1;     ///< which of them, from the beginning
    double readings_ = 0, most_readings_ = 0;
    std::array<std::array<double, 2>, kReported + 1> phasor_{};
    std::array<double, kReported + 1> power_{};
};

}  // namespace vibrig::estimator
