#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tests/plant/accelerometer_band.hpp"
#include "tests/plant/drift.hpp"
#include "tests/plant/gimbals.hpp"
#include "tests/plant/increments.hpp"
#include "tests/plant/isolator.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/plant/random_drive.hpp"
#include "tests/plant/sensors.hpp"
#include "tests/plant/shaker_controller.hpp"

namespace vibrig::plant {

/// The whole rig: platform in its gimbals on isolators on a shaker. Knows no bus and no wall clock;
/// deterministic for a seed. One thread at a time.
class Rig {
  public:
    explicit Rig(const Truth& truth);

    /// As the channels of the command say.
    void slew_to(const Vec3& command_deg, GimbalMode mode = GimbalMode::slew);
    void release() noexcept;
    void torque(const Vec3& deg_per_h) noexcept { torque_ = deg_per_h; }
    /// The random walk of the gyros from now on, times that of the truth.
    void gyro_noise_times(double factor) noexcept { gyro_noise_times_ = factor; }
    /// Rocking in step with the vibration and what goes across the vertical, over the truth's.
    void grow(double rocking, double across) noexcept { platform_.grow(rocking, across); }
    /// The table's second harmonic from its next change of frequency on, beside the truth's; `hz`:
    /// at that frequency alone, 0: at each.
    void distort(double share, double hz) noexcept { distorted_ = {share, hz}; }
    [[nodiscard]] ShakerController& shaker() noexcept { return shaker_; }
    [[nodiscard]] const ShakerController& shaker() const noexcept { return shaker_; }

    /// Time goes on by one tick, then the instruments are read.
    void advance();

    [[nodiscard]] std::int64_t time_us() const noexcept { return tick_ * tick_us_; }
    /// Between two samples.
    [[nodiscard]] std::int64_t tick_us() const noexcept { return tick_us_; }
    [[nodiscard]] std::int64_t tick() const noexcept { return tick_; }
    [[nodiscard]] const Readings& readings() const noexcept { return readings_; }
    /// Of the tick just past; in mode calibrate only.
    [[nodiscard]] const std::vector<Increment>& increments() const noexcept {
        return increments_.made();
    }
    [[nodiscard]] const Vec3& torque() const noexcept { return torque_; }
    [[nodiscard]] const Gimbals& gimbals() const noexcept { return gimbals_; }
    [[nodiscard]] bool ready() const noexcept;
    [[nodiscard]] bool gyros_at_speed() const noexcept;
    [[nodiscard]] const Truth& truth() const noexcept { return truth_; }

    // what only a simulation can know
    [[nodiscard]] const PlatformModel& platform() const noexcept { return platform_; }
    [[nodiscard]] const Drift& drift() const noexcept { return drift_; }

  private:
    void vibrate();
    void vibrate_at_random(const ShakerProfile& profile, double begin_g, double end_g);
    void move();
    void read();
    [[nodiscard]] double table_g() const noexcept;
    void feel() noexcept;
    /// What the accelerometers show of the vibration, up to a tick ago.
    [[nodiscard]] Shake felt_before(double seconds) const noexcept;
    [[nodiscard]] Vec3 encoder_deg() const noexcept;

    Truth truth_;
    std::int64_t tick_us_;
    double tick_s_;      ///< by the rig's clock
    double passing_s_;   ///< really, in a tick
    std::size_t steps_;  ///< of the vibration per tick, even, 0.5 ms or a little less; 0.125 ms
                         ///< where a gyro is elastic, the table shakes at random or
                         ///< accelerometers are narrow or not read at once
    PlatformModel platform_;
    Gimbals gimbals_;
    Isolator isolator_;
    RandomDrive random_drive_;
    bool heard_ = false;  ///< it is at level
    ShakerController shaker_;
    Sensors sensors_;
    Increments increments_;
    Drift drift_;
    Random gyro_noise_;
    double gyro_noise_times_ = 1;
    std::array<double, 2> distorted_{};  ///< share, Hz
    Random slew_noise_;
    Vec3 torque_{};
    Vec3 commanded_deg_{};  ///< of the last slew, and its error
    Vec3 slew_error_deg_{};
    double frequency_hz_ = 0;                ///< the isolator is set to
    double shaking_s_ = 0;                   ///< since the table was last at rest
    const ShakerProfile* shaped_ = nullptr;  ///< that the drive has
    std::vector<Shake> played_;              ///< of the table, as shakes_; the last one is now
    std::vector<Shake> shakes_;
    std::optional<AccelerometerBand> band_;
    std::vector<Shake> felt_;  ///< of the accelerometers, as shakes_
    bool still_ = true;        ///< no vibration in this tick
    std::int64_t tick_ = 0;
    Readings readings_;
};

}  // namespace vibrig::plant
