#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tests/plant/platform_model.hpp"
#include "tests/plant/random.hpp"

namespace vibrig::plant {

/// What gyros and accelerometers have summed up over 10 ms, in their own axes.
struct Increment {
    std::uint64_t count = 0;
    Vec3 turn_arcsec{};
    Vec3 velocity_mps{};
};

/// Gyros and accelerometers as integrating instruments while the gimbals hold or turn the platform:
/// exact rotations of the platform against inertial space, not an error model.
class Increments {
  public:
    /// Ticks of `tick_us` each.
    Increments(const Truth& truth, std::int64_t tick_us);

    struct Motion {
        Vec3 from{}, to{};  ///< gimbal angles at both ends of the tick, rad; straight between them
    };
    /// The tick that ends at `end_us`; `shakes` is the vibration at equal steps of it.
    void advance(std::int64_t end_us, const Motion& motion, const PlatformModel& platform,
                 std::span<const Shake> shakes);
    /// Nothing is sent; the next increment begins anew.
    void stop() noexcept;
    [[nodiscard]] const std::vector<Increment>& made() const noexcept { return made_; }

  private:
    void make(const Vec3& from, const Vec3& to, const PlatformModel& platform, double shaken_s);

    Truth truth_;
    std::int64_t tick_us_;
    Mat3 platform_to_raw_;
    Random gyro_noise_;
    Random accelerometer_noise_;
    std::vector<Increment> made_;
    std::uint64_t count_ = 0;
    bool begun_ = false;
    Vec3 begin_{};                        ///< angles when the present increment began
    double shaken_s_ = 0;                 ///< integral of the vibration since then, g s
    Vec3 rest_turn_{}, rest_velocity_{};  ///< less than a count, left for the next increment
};

}  // namespace vibrig::plant
