#include "estimator/level/paper_level.hpp"

#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {

PaperLevel::PaperLevel(double frequency_hz, double forgetting) noexcept
    : omega_(2.0 * kPi * frequency_hz), forgetting_(forgetting) {}

void PaperLevel::begin() noexcept {
    start_ = blended_ = cosine_ = sine_ = 0;
    power_ = 1;
    n_ = 0;
    has_start_ = false;
}

void PaperLevel::begin(double start_amplitude_g) noexcept {
    begin();
    start_ = blended_ = start_amplitude_g;
    has_start_ = true;
}

void PaperLevel::add(double time_s, double square) noexcept {
    if (n_ == 0) first_time_ = time_s;
    const double angle = omega_ * (time_s - first_time_);
    cosine_ += square * std::cos(angle);
    sine_ += square * std::sin(angle);
    ++n_;
    // eq. 13: c1, s1 = 2/n sum S cos, 2/n sum S sin; a0 = sqrt(c1^2 + s1^2) / 2
    const double amplitude = std::hypot(cosine_, sine_) / static_cast<double>(n_);
    if (!has_start_) {
        blended_ = amplitude;
        return;
    }
    // eq. 18: a2(n) = lambda^n a2 + (1 - lambda^n) a2'(n)
    power_ *= forgetting_;
    blended_ = power_ * start_ + (1.0 - power_) * amplitude;
}

}  // namespace vibrig::estimator
