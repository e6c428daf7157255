#include "daemon/interlock/mean_motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::rt {

namespace {
constexpr double kMostBad = 0.5;
}  // namespace

void MeanMotionMeter::begin(bool excited) noexcept {
    excited_ = excited;
    begun_ = false;
}

bool MeanMotionMeter::add(const drivers::Sample& sample) noexcept {
    constexpr double kTurn = 2 * std::numbers::pi;
    bool over = false;
    if (begun_ && sample.time - from_ >= drivers::kSecond) {
        over = true;
        mean_.from = from_;
        mean_.to = sample.time;
        bool stood = true;
        for (std::size_t i = 0; i < 3; ++i) {
            stood = stood && angle_high_[i] - angle_low_[i] <= kStandsRad;
            mean_.angle[i] = first_[i] + angle_sum_[i] / std::max(good_, 1.0);
            mean_.force[i] = sum_[i] / std::max(good_, 1.0);
        }
        mean_.cosine = mean_.sine = {};
        mean_.good = stood && good_ >= kFewestOfSecond && good_ >= (1 - kMostBad) * all_;
        // A second need not be a whole number of periods, nor of those of the samples' alias.
        if (excited_) {
            LockIn<3>::Fit fit;
            mean_.good = mean_.good && lock_in_.fit(fit, kFewestOfSecond);
            if (mean_.good) {
                mean_.force = fit.mean;
                mean_.cosine = fit.cosine;
                mean_.sine = fit.sine;
            }
        }
        begun_ = false;
    }
    if (!begun_ || sample.time < from_) {
        begun_ = true;
        from_ = sample.time;
        lock_in_.clear();
        sum_ = angle_sum_ = angle_low_ = angle_high_ = {};
        good_ = all_ = 0;
    }
    ++all_;
    if (!sample.force_good() || !sample.angles_good()) return over;
    if (++good_ == 1) first_ = sample.angle;
    for (std::size_t i = 0; i < 3; ++i) {
        const double away = std::remainder(sample.angle[i] - first_[i], kTurn);
        angle_sum_[i] += away;
        angle_low_[i] = std::min(angle_low_[i], away);
        angle_high_[i] = std::max(angle_high_[i], away);
        sum_[i] += sample.force[i];
    }
    const double turns = frequency_hz_ * drivers::to_seconds(sample.time - from_);
    const double angle = kTurn * (turns - std::floor(turns));
    lock_in_.add(std::cos(angle), std::sin(angle), sample.force);
    return over;
}

}  // namespace vibrig::rt
