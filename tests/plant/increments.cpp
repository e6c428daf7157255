#include "tests/plant/increments.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::plant {
namespace {

constexpr std::int64_t kIncrementUs = 10'000;
constexpr double kIncrement = 1e-6 * kIncrementUs;
constexpr double kArcsecOfRad = 180 * 3600 / std::numbers::pi;
// Counts of the frames, see rig.dbc. The instrument counts pulses: what is left of one stays in it.
constexpr double kTurnCount = 0.002;     ///< arcsec
constexpr double kVelocityCount = 1e-5;  ///< m/s
constexpr double kLargestCount = 131071;

double counted(double value, double& rest, double count) {
    const double whole = std::round((value + rest) / count);
    rest += value - whole * count;
    return std::clamp(whole, -kLargestCount, kLargestCount) * count;
}

/// Columns: the axes of the reference frame in platform axes.
std::array<Vec3, 3> attitude(const PlatformModel& platform, const Vec3& angles) {
    return {platform.seen(angles, {1, 0, 0}), platform.seen(angles, {0, 1, 0}),
            platform.seen(angles, {0, 0, 1})};
}

}  // namespace

Increments::Increments(const Truth& truth, std::int64_t tick_us)
    : truth_(truth),
      tick_us_(tick_us),
      platform_to_raw_(inverse(truth.matrix)),
      gyro_noise_(truth.seed, 5),
      accelerometer_noise_(truth.seed, 6) {}

void Increments::stop() noexcept {
    made_.clear();
    begun_ = false;
}

void Increments::advance(std::int64_t end_us, const Motion& motion, const PlatformModel& platform,
                         std::span<const Shake> shakes) {
    made_.clear();
    const std::int64_t begin_us = end_us - tick_us_;
    // Angles are given within a turn: where one passes half a turn, it goes on and not all the way
    // back.
    Vec3 moved = motion.to - motion.from;
    for (double& angle : moved) angle = std::remainder(angle, 2 * std::numbers::pi);
    const double step_s =
        1e-6 * static_cast<double>(tick_us_) / static_cast<double>(shakes.size() - 1);
    const auto at = [&](std::int64_t us) {
        return motion.from +
               (static_cast<double>(us - begin_us) / static_cast<double>(tick_us_)) * moved;
    };
    std::int64_t from = begin_us;
    while (from < end_us) {
        const std::int64_t boundary = (from / kIncrementUs + 1) * kIncrementUs;
        const std::int64_t to = std::min(boundary, end_us);
        const auto index = [&](std::int64_t us) {
            return static_cast<std::size_t>(
                (us - begin_us) * static_cast<std::int64_t>(shakes.size() - 1) / tick_us_);
        };
        for (std::size_t i = index(from); i < index(to); ++i)
            shaken_s_ += 0.5 * step_s * (shakes[i].in_phase + shakes[i + 1].in_phase);
        if (to == boundary) {
            const Vec3 angles = at(to);
            if (begun_) make(begin_, angles, platform, shaken_s_);
            begun_ = true;
            begin_ = angles;
            shaken_s_ = 0;
        }
        from = to;
    }
}

void Increments::make(const Vec3& from, const Vec3& to, const PlatformModel& platform,
                      double shaken_s) {
    const auto before = attitude(platform, from);
    auto after = attitude(platform, to);
    // Seen from inertial space the reference frame turns with the Earth, by an angle so small that
    // its square does not count: an axis r of it has become r + w x r.
    const Vec3 earth = (kIncrement / kArcsecOfRad) * platform.earth_rate_in_platform(to);
    // The platform's turn takes its axes of before to those of after: half the difference of the
    // matrix (before)(after turned back)^T and its transpose.
    for (Vec3& axis : after) axis = axis - cross(earth, axis);
    Vec3 turn{};
    for (std::size_t i = 0; i < 3; ++i) turn = turn + 0.5 * cross(after[i], before[i]);
    const double sine = std::sqrt(dot(turn, turn));
    if (sine > 1e-9) turn = (std::asin(std::min(1.0, sine)) / sine) * turn;

    Vec3 middle = to - from;
    for (double& angle : middle) angle = 0.5 * std::remainder(angle, 2 * std::numbers::pi);
    middle = from + middle;
    const Vec3 up = platform.up_at(middle);
    const double a1 = shaken_s / kIncrement;
    const Vec3 drift = platform.gyro_drift(up, a1);
    const Vec3 velocity =
        (truth_.gravity_mps2 * (kIncrement + shaken_s)) * (platform_to_raw_ * up) +
        (truth_.gravity_mps2 * kIncrement) * truth_.zero_g;
    const double random_walk = 60 * truth_.gyro_random_walk_deg_per_rt_h * std::sqrt(kIncrement);
    // Same density as the samples' noise, which is one value per tick.
    const double noise = truth_.accelerometer_g * truth_.gravity_mps2 *
                         std::sqrt(1e-6 * static_cast<double>(tick_us_)) * std::sqrt(kIncrement);
    Increment increment;
    increment.count = count_++;
    for (std::size_t i = 0; i < 3; ++i) {
        // A gyro that is not nulled by the loop shows the rate and its drift, whose sign is such
        // that nulling the output leaves the platform with drift_sign times the drift.
        const double angle = kArcsecOfRad * turn[i] - truth_.drift_sign * drift[i] * kIncrement +
                             random_walk * gyro_noise_.normal();
        increment.turn_arcsec[i] =
            truth_.increment_sign[i] * counted(angle, rest_turn_[i], kTurnCount);
        increment.velocity_mps[i] = counted(velocity[i] + noise * accelerometer_noise_.normal(),
                                            rest_velocity_[i], kVelocityCount);
    }
    made_.push_back(increment);
}

}  // namespace vibrig::plant
