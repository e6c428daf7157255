#include "estimator/level/in_step.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/level/sync_motion.hpp"

namespace vibrig::estimator {
namespace {

constexpr double kLeast_g = 0.005;  // below, nothing vibrates
// Beyond this many sigmas once in 1e9, in six and in four dimensions.
constexpr double kChanceOfSix = 7.304, kChanceOfFour = 6.919;
constexpr double kSystematic = 3;  // standard uncertainties of what instruments do always

struct Line {
    double first = 0, constant = 0, slope = 0;
};

/// Angles unwrapped about the first one, by least squares over time from the middle.
Line line_of(std::span<const LoopReading> readings, std::size_t axis, double middle_s) {
    Line line;
    line.first = readings.front().angle_rad[axis];
    double sum = 0, times = 0, products = 0, squares = 0;
    for (const LoopReading& r : readings) {
        const double t = r.time_s - middle_s;
        const double angle = std::remainder(r.angle_rad[axis] - line.first, 2 * kPi);
        sum += angle;
        times += t;
        products += t * angle;
        squares += t * t;
    }
    const auto n = static_cast<double>(readings.size());
    const double spread = squares - times * times / n;
    line.slope = spread > 0 ? (products - times * sum / n) / spread : 0;
    line.constant = (sum - line.slope * times) / n;
    return line;
}

}  // namespace

InStep in_step(std::span<const LoopReading> readings, double hz, const Settings& settings) {
    const LoopResponse response = loop_response_at(readings, hz);
    if (!(response.platform_g >= kLeast_g)) return {};
    InStep out;
    out.platform_g = response.platform_g;
    out.cross_share = response.cross_share;
    out.cross_sigma = response.cross_sigma;
    out.distortion = response.distortion;

    const double begin_s = readings.front().time_s;
    const double middle_s = (begin_s + readings.back().time_s) / 2;
    std::array<Line, 3> lines{};
    for (std::size_t k = 0; k < 3; ++k) lines[k] = line_of(readings, k, middle_s);
    SyncMotion motion(hz);
    double left = 0;
    for (const LoopReading& r : readings) {
        std::array<double, 3> arcsec{};
        for (std::size_t k = 0; k < 3; ++k) {
            const double angle = std::remainder(r.angle_rad[k] - lines[k].first, 2 * kPi);
            const double off = angle - lines[k].constant - lines[k].slope * (r.time_s - middle_s);
            arcsec[k] = settings.encoder_sign[k] * off / kRadPerArcsec;
            left += arcsec[k] * arcsec[k];
        }
        motion.add(r.time_s - begin_s, arcsec);
    }
    const auto found = motion.lines(hz);
    double square = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto& [re, im] = found.amplitude[k];
        out.gimbal_arcsec[k] = std::hypot(re, im);
        square += re * re + im * im;
    }
    // Line and sine have taken four of the numbers of each encoder.
    const auto n = static_cast<double>(readings.size());
    const double configured = noise_levels(settings).angle_arcsec;
    const double variance =
        std::max(configured * configured, (left - n * square / 2) / (3 * (n - 4)));
    // The outer gimbal's axis leans against the azimuth gimbal's by the inner gimbal's angle.
    const double lean = std::sin(Kinematics(settings).gimbal_angles(readings.front().angle_rad)[1]);
    const auto& [outer, inner, azimuth] = found.amplitude;
    const double turn = square - 2 * lean * (outer[0] * azimuth[0] + outer[1] * azimuth[1]);
    const double noise = variance * found.noise_square;
    out.motion_arcsec_g = std::sqrt(std::max(0.0, turn - 3 * noise)) / out.platform_g;
    out.motion_sigma = std::sqrt(noise / 2) / out.platform_g;
    return out;
}

Growth motion_growth(const InStep& before, const InStep& now) {
    // What noise left in the square was taken out: of what was, its root may be missing.
    const double allowance = kChanceOfSix * std::hypot(before.motion_sigma, now.motion_sigma) +
                             std::sqrt(6.0) * before.motion_sigma;
    const double expected = before.motion_arcsec_g + allowance / Growth::kGrown;
    return {expected, expected > 0 ? now.motion_arcsec_g / expected : 0};
}

Growth cross_growth(const InStep& before, const InStep& now, double hz, const Settings& settings) {
    const uncertainty::Inputs& inputs = settings.uncertainty;
    double zero = 0;
    for (const auto& axis : inputs.accelerometer_zero_g) zero = std::max(zero, axis.u);
    const double always = std::hypot(inputs.gain_between_frequencies.u, std::numbers::sqrt2 * zero);
    const double allowance = kChanceOfFour * std::hypot(before.cross_sigma, now.cross_sigma) +
                             kSystematic * always +
                             2 * kPi * hz * 1e-3 * settings.accelerometer_response.skew_ms;
    const double expected = before.cross_share + allowance / Growth::kGrown;
    return {expected, expected > 0 ? now.cross_share / expected : 0};
}

}  // namespace vibrig::estimator
