#include "estimator/level/harmonics.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {
namespace {

constexpr double kWindow_s = 1;
constexpr double kHighest = 0.45;  ///< of the sampling rate
constexpr double kWhole = 0.9;     ///< of the readings that a window has at most
constexpr double kLeast = 1e-4;

}  // namespace

std::size_t Harmonics::reported(double period_s) const noexcept {
    std::size_t n = 0;
    while (n < kReported && static_cast<double>(n + 2) * hz_ * period_s < kHighest) ++n;
    return n;
}

void Harmonics::begin(double hz, double period_s) noexcept {
    *this = {};
    hz_ = hz;
    const std::size_t n = hz > 0 ? reported(period_s) : 0;
    lines_ = n > 0 ? n + 1 : 0;
}

void Harmonics::add(double time_s, double force_g) noexcept {
    if (lines_ == 0 || !(time_s >= 0)) return;
    const double window = std::floor(time_s / kWindow_s);
    if (window != window_) {
        close();
        window_ = window;
    }
    const double share = time_s / kWindow_s - window;
    const double half = std::sin(kPi * share), weighed = half * half * force_g;
    const double phase = 2 * kPi * hz_ * time_s, c = std::cos(phase), s = std::sin(phase);
    double re = c, im = s;
    for (std::size_t n = 0; n < lines_; ++n) {
        phasor_[n][0] += re * weighed;
        phasor_[n][1] += im * weighed;
        const double next = re * c - im * s;
        im = re * s + im * c;
        re = next;
    }
    readings_ += 1;
}

void Harmonics::close() noexcept {
    // One with a gap in it smears every line.
    if (readings_ > 0 && readings_ >= kWhole * most_readings_) {
        for (std::size_t n = 0; n < lines_; ++n)
            power_[n] += (phasor_[n][0] * phasor_[n][0] + phasor_[n][1] * phasor_[n][1]) /
                         (readings_ * readings_);
    }
    most_readings_ = std::max(most_readings_, readings_);
    phasor_ = {};
    readings_ = 0;
}

Harmonics::Shares Harmonics::shares(double period_s) const noexcept {
    Shares out{};
    const std::size_t n = std::min(reported(period_s), lines_ > 0 ? lines_ - 1 : 0);
    double all = power_[0];
    for (std::size_t k = 0; k < n; ++k) all += power_[k + 1];
    if (!(all > 0)) return out;
    for (std::size_t k = 0; k < n; ++k) {
        const double share = power_[k + 1] / all;
        if (share >= kLeast) out[k] = share;
    }
    return out;
}

}  // namespace vibrig::estimator
