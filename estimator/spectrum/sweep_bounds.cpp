#include "estimator/spectrum/sweep_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/spectrum/sweep_blocks.hpp"

namespace vibrig::estimator::spectrum {

namespace {

/// Of a rate of which nothing is left by its rounding there is no bound: half of it.
constexpr double kMostOff = 0.5;

/// What a Hann window leaves of the power of a line that is x bins off, 0 < x < 1.
double power_left(double x) {
    const double arc = std::numbers::pi * x, response = std::sin(arc) / arc / (1 - x * x);
    return response * response;
}

}  // namespace

double SweepBounds::unseen_hz() {
    double low = 1e-3, high = 1 - 1e-3;
    for (int k = 0; k < 60; ++k) {
        const double middle = (low + high) / 2;
        (power_left(middle) > SweepBlocks::kShown ? low : high) = middle;
    }
    return low / SweepBlocks::kBlock_s;
}

SweepBounds::SweepBounds(const SweptSine& of, const SweptBy& by)
    : of_(of), by_(by), off_hz_(unseen_hz() + by.frequency_step_hz / 2) {
    const double octaves_per_minute = 60 * std::abs(std::log2(of.to_hz / of.from_hz)) / of.seconds;
    rate_off_ = std::min(kMostOff, by.rate_tolerance + by.rate_step / 2 / octaves_per_minute);
}

double SweepBounds::off_s(double hz) const noexcept {
    return off_hz_ * of_.seconds / (hz * std::abs(std::log(of_.to_hz / of_.from_hz)));
}

double SweepBounds::begins_s() const noexcept {
    return by_.begins_s + 2 * off_s(of_.from_hz) / (1 - rate_off_);
}

double SweepBounds::late_s(double hz, double lasted_s) const noexcept {
    const double lasted = std::clamp(lasted_s, 0.0, of_.seconds / (1 - rate_off_));
    return by_.poll_s + off_s(of_.from_hz) + off_s(hz) + rate_off_ * lasted;
}

double SweepBounds::dwell_s() const noexcept {
    return begins_s() + by_.poll_s + off_s(of_.to_hz) + of_.seconds / (1 - rate_off_);
}

}  // namespace vibrig::estimator::spectrum
