#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "drivers/sample/sample.hpp"

namespace vibrig::rt {

/// Cross-axis motion and tilt from the three accelerometers alone, whatever the gimbal angles: the
/// mean specific force is the vertical, its turning is tilt, and of the covariance about it what
/// does not lie along it is cross-axis motion. Exponential means; fixed memory.
class MotionMonitor {
  public:
    static constexpr double kTimeConstant_s = 2.0;  ///< of a sine
    static constexpr double kLeastAxial_g = 0.05;   ///< rms; below, a share means nothing

    /// Excitation begins: the vertical is learnt anew.
    void begin() noexcept { *this = {}; }
    /// The same under a random vibration, whose mean takes so long to show the vertical; none:
    /// there is no verdict.
    void begin(std::optional<double> time_constant_s) noexcept {
        *this = {};
        time_constant_s_ = time_constant_s.value_or(0);
    }
    /// Samples whose force is good only.
    void add(const drivers::Sample& sample) noexcept;

    /// rms across over rms along the vertical; negative while it is not known.
    [[nodiscard]] double cross_share() const noexcept;
    /// Angle between the vertical now and when it was first known, deg; negative: not known.
    [[nodiscard]] double tilt_deg() const noexcept;

  private:
    using Vector = std::array<double, 3>;
    drivers::Time first_ = 0, last_ = 0;
    Vector mean_{}, reference_{};
    std::array<double, 6> covariance_{};  ///< xx yy zz xy xz yz
    bool known_ = false;
    double time_constant_s_ = kTimeConstant_s;  ///< 0: never known
};

/// Share of samples that were lost or incomplete over the last ten seconds or so.
class LossMonitor {
  public:
    static constexpr std::size_t kSeconds = 10;

    /// Running totals: samples given out, and of the ones due those lost or incomplete.
    void add(drivers::Time now, std::uint64_t samples, std::uint64_t incomplete,
             std::uint64_t gaps) noexcept;
    [[nodiscard]] double percent() const noexcept { return percent_; }

  private:
    struct Totals {
        std::uint64_t due = 0, bad = 0;
    };
    std::array<Totals, kSeconds> past_{};
    std::size_t next_ = 0, filled_ = 0;
    drivers::Time taken_ = 0;
    double percent_ = 0;
};

}  // namespace vibrig::rt
