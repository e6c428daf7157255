#pragma once

#include <array>
#include <cstdint>

#include "daemon/interlock/lock_in.hpp"
#include "drivers/sample/sample.hpp"

namespace vibrig::rt {

/// Of a second that is good: with fewer, its mean and its vibration are not known.
inline constexpr double kFewestOfSecond = 5;

/// One second of the platform: where its gimbals were and what its accelerometers showed.
struct MeanMotion {
    drivers::Time from = 0, to = 0;
    std::array<double, 3> force{};           ///< raw, g; the vibration is taken out
    std::array<double, 3> cosine{}, sine{};  ///< that vibration: raw, g, peak; 0 at rest
    std::array<double, 3> angle{};           ///< encoders, rad
    bool good = false;                       ///< half of the samples were, and the gimbals stood
};

/// Second by second. Acquisition thread; no allocation.
class MeanMotionMeter {
  public:
    explicit MeanMotionMeter(double frequency_hz) : frequency_hz_(frequency_hz) {}
    /// A second that has begun is given up; `excited` holds for what comes.
    void begin(bool excited) noexcept;
    /// From here on the vibration is at this frequency; a second that has begun is given up.
    void retune(double frequency_hz) noexcept {
        if (frequency_hz == frequency_hz_) return;
        frequency_hz_ = frequency_hz;
        begun_ = false;
    }
    /// True: a second is over, and mean() is it.
    [[nodiscard]] bool add(const drivers::Sample& sample) noexcept;
    [[nodiscard]] const MeanMotion& mean() const noexcept { return mean_; }

  private:
    static constexpr double kStandsRad = 5e-3;  ///< 0.3 deg, largest less smallest
    double frequency_hz_;
    bool excited_ = false, begun_ = false;
    drivers::Time from_ = 0;
    LockIn<3> lock_in_;
    std::array<double, 3> sum_{}, first_{}, angle_sum_{}, angle_low_{}, angle_high_{};
    double good_ = 0, all_ = 0;
    MeanMotion mean_;
};

}  // namespace vibrig::rt
