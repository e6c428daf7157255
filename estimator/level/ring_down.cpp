#include "estimator/level/ring_down.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace vibrig::estimator {
namespace {

constexpr std::size_t kFewestOfSwing = 8;
// Between the readings that are compared: with less, noise drowns what the swing has done
// meanwhile.
constexpr double kSwingLag_s = 0.02;

double norm_of(const LoopReading& reading) {
    const auto& f = reading.force_g;
    return std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
}

}  // namespace

RingDown ring_down(std::span<const LoopReading> readings, double floor_g) {
    if (readings.size() < kFewestOfSwing) return {};
    const double period_s = (readings.back().time_s - readings.front().time_s) /
                            static_cast<double>(readings.size() - 1);
    if (!(period_s > 0)) return {};
    const auto rest = readings.last(readings.size() / 4);
    double mean = 0;
    for (const auto& reading : rest) mean += norm_of(reading) / static_cast<double>(rest.size());
    std::vector<double> x;
    x.reserve(readings.size());
    for (const auto& reading : readings) x.push_back(norm_of(reading) - mean);
    // What the noise has taken over says nothing of the decay: up to the last crest above it.
    while (!x.empty() && std::abs(x.back()) < floor_g) x.pop_back();
    if (x.size() < kFewestOfSwing ||
        x.size() <= 2 * static_cast<std::size_t>(kSwingLag_s / period_s))
        return {};
    double s11 = 0, s12 = 0, s22 = 0, r1 = 0, r2 = 0;
    const auto lag = static_cast<std::size_t>(std::max(1.0, std::round(kSwingLag_s / period_s)));
    const double lag_s = static_cast<double>(lag) * period_s;
    for (std::size_t n = 2 * lag; n < x.size(); ++n) {
        const double one = x[n - lag], two = x[n - 2 * lag];
        s11 += one * one;
        s12 += one * two;
        s22 += two * two;
        r1 += x[n] * one;
        r2 += x[n] * two;
    }
    const double determinant = s11 * s22 - s12 * s12;
    if (!(determinant > 0)) return {};
    const double a = (r1 * s22 - r2 * s12) / determinant;
    const double b = -(r2 * s11 - r1 * s12) / determinant;
    if (!(b > 0 && b < 1)) return {};
    RingDown found;
    found.rate_per_s = -std::log(b) / (2 * lag_s);
    const double cosine = std::clamp(a / (2 * std::sqrt(b)), -1.0, 1.0);
    const double damped = std::acos(cosine) / lag_s;
    const double omega = std::hypot(damped, found.rate_per_s);
    found.frequency_hz = omega / (2 * std::numbers::pi);
    found.damping = found.rate_per_s / omega;
    return found;
}

}  // namespace vibrig::estimator
