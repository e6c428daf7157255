#include "estimator/level/vibration_level.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {
namespace {

constexpr double kMostOfIt = 0.5;  ///< share of the mean square

/// Of what aliases to nearly nothing, in a window that knows a level: 4, and a hundredth less,
/// since what is planned at 4 is sampled by a clock that is a little off.
constexpr double kLeastTurns = 3.96;

/// How far from a multiple of the sample rate.
double beside_hz(double frequency_hz, double rate_hz) noexcept {
    const double m = std::max(1.0, std::round(frequency_hz / rate_hz));
    return std::abs(frequency_hz - m * rate_hz);
}

std::size_t samples_in(double seconds, double period_s) noexcept {
    return static_cast<std::size_t>(std::max(1.0, std::round(seconds / period_s)));
}

}  // namespace

VibrationLevel::VibrationLevel(double window_s, double noise_g, double nominal_hz)
    : window_s_(window_s),
      noise_g_(noise_g),
      nominal_hz_(nominal_hz),
      ring_(static_cast<std::size_t>(window_s * kHighestRate_hz)),
      valid_(std::make_unique<bool[]>(ring_.size())),
      hann_(ring_.size()) {}

void VibrationLevel::begin(double period_s) noexcept {
    period_s_ = period_s;
    window_ = std::min(samples_in(window_s_, period_s), ring_.size());
    shortest_ = samples_in(std::clamp(shortest_window_s(nominal_hz_, period_s), kFirstWindow_s,
                                      std::max(kFirstWindow_s, window_s_)),
                           period_s);
    refresh_every_ = samples_in(kRefresh_s, period_s);
    fit_every_ = samples_in(1.0, period_s);
    next_ = filled_ = since_refresh_ = since_fit_ = fit_age_ = 0;
    whole_.clear();
    fit_ = {};
    fit_is_due_ = false;
    kappa_ = 1;
}

void VibrationLevel::push(double value, bool valid) noexcept {
    if (fit_age_ >= ring_.size()) static_cast<void>(fitted());  // before its window is written over
    ring_[next_] = value;
    valid_[next_] = valid;
    if (++next_ == ring_.size()) next_ = 0;
    filled_ = std::min(filled_ + 1, ring_.size());
}

void VibrationLevel::prime() noexcept {
    fit(filled_);
    for (std::size_t i = 0; i < filled_; ++i) {
        if (!valid_[i]) ring_[i] = fitted().at(static_cast<double>(i) * period_s_);
        whole_.add(ring_[i]);
    }
    refresh();
}

void VibrationLevel::add(double vertical_force_g) noexcept { take(vertical_force_g, true); }

void VibrationLevel::add_missing() noexcept {
    // A hole would not average out: one missing peak of 6 g in 400 samples moves the mean by 3 %.
    if (since_fit_ >= refresh_every_) fit(std::min(filled_, shortest_));
    take(fitted().at(static_cast<double>(fit_age_) * period_s_), false);
}

void VibrationLevel::take(double value, bool valid) noexcept {
    push(value, valid);
    whole_.add(value);
    ++fit_age_;
    ++since_fit_;
    if (++since_refresh_ >= refresh_every_) refresh();
    if (since_fit_ >= fit_every_) fit(std::min(filled_, window_));
}

void VibrationLevel::refresh() noexcept {
    since_refresh_ = 0;
    const std::size_t n = std::min(filled_, window_);
    const std::size_t begin = (next_ + ring_.size() - n) % ring_.size();
    HannMeans means = hann_.means(ring_.data(), ring_.size(), begin, n);
    if (n <= 2 * samples_in(kFirstWindow_s, period_s_)) remove_leakage(means, n);
    kappa_ = kappa_of(means);
}

void VibrationLevel::remove_leakage(HannMeans& means, std::size_t n) const noexcept {
    if (fit_age_ < n || !(fitted().amplitude > 0)) return;
    // Lines that alias on one another are not told apart by the fit.
    const double span_s = static_cast<double>(n) * period_s_;
    for (const int order : {2, 3, 4}) {
        if (excluded(fit_.frequency_hz, period_s_, span_s, order)) return;
    }
    double mean = 0, mean_square = 0, weights = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double s = std::sin(kPi * (static_cast<double>(i) + 0.5) / static_cast<double>(n));
        const double value = fit_.at(static_cast<double>(fit_age_ - n + i) * period_s_);
        weights += s * s;
        mean += s * s * value;
        mean_square += s * s * value * value;
    }
    const double lines = fit_.cosine * fit_.cosine + fit_.sine * fit_.sine +
                         fit_.cosine2 * fit_.cosine2 + fit_.sine2 * fit_.sine2;
    means.mean -= mean / weights - fit_.mean;
    means.mean_square -= mean_square / weights - (fit_.mean * fit_.mean + 0.5 * lines);
}

void VibrationLevel::fit(std::size_t samples) noexcept {
    since_fit_ = 0;
    fit_begin_ = (next_ + ring_.size() - samples) % ring_.size();
    fit_samples_ = fit_age_ = samples;
    fit_is_due_ = true;
}

const Vibration& VibrationLevel::fitted() const noexcept {
    if (!std::exchange(fit_is_due_, false)) return fit_;
    return fit_ = lock_in(
               {ring_.data(), valid_.get(), ring_.size(), fit_begin_, fit_samples_, period_s_},
               nominal_hz_);
}

double VibrationLevel::kappa_of(const HannMeans& means) const noexcept {
    // Far from 1 g the dwell is rejected anyway; a level is not made up from it.
    if (!(std::abs(means.mean) > 0.1)) return kappa_;
    const double kappa = means.mean_square / (means.mean * means.mean) - noise_g_ * noise_g_;
    return kappa - 1.0 < kAtRest ? 1.0 : kappa;
}

VibrationLevel::Whole VibrationLevel::whole() const noexcept {
    const HannMeans means = whole_.means();
    return {kappa_of(means), means.mean};
}

double VibrationLevel::amplitude_g() const noexcept { return std::sqrt(2.0 * (kappa_ - 1.0)); }

double VibrationLevel::frequency_hz() const noexcept {
    if (!(kappa_ > 1.0)) return 0.0;
    // The lock-in finds a line near the nominal frequency in whatever it is given: it has to be
    // most of what vibrates.
    const Vibration& line = fitted();
    return line.variance > kMostOfIt * (kappa_ - 1.0) ? line.frequency_hz : 0.0;
}

bool VibrationLevel::excluded(double frequency_hz, double period_s, double window_s,
                              int order) noexcept {
    return beside_hz(order * frequency_hz, 1.0 / period_s) < kLeastTurns / window_s;
}

double VibrationLevel::shortest_window_s(double frequency_hz, double period_s) noexcept {
    const double rate = 1.0 / period_s;
    return kLeastTurns / std::min(beside_hz(frequency_hz, rate), beside_hz(2 * frequency_hz, rate));
}

const char* VibrationLevel::aliasing(double frequency_hz, double period_s,
                                     double window_s) noexcept {
    if (excluded(frequency_hz, period_s, window_s, 3))
        return "the vibration is close to a third of the sample rate: a second harmonic of the "
               "shaker falsifies the level";
    if (excluded(frequency_hz, period_s, window_s, 4))
        return "the vibration is close to a quarter of the sample rate: a third harmonic of the "
               "shaker falsifies the level";
    if (excluded(frequency_hz, period_s, window_s, 5))
        return "the vibration is close to a fifth of the sample rate: a fourth harmonic of the "
               "shaker falsifies the level";
    return "";
}

}  // namespace vibrig::estimator
