#include "estimator/spectrum/read_sweep.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::estimator::spectrum {

void ReadSweep::frequency(double time_s, double hz) {
    if (!readings_.empty() && !(time_s > readings_.back()[0])) return;
    readings_.push_back({time_s, hz});
    while (!waiting_.empty() && waiting_.front().time_s <= time_s) {
        take(waiting_.front());
        waiting_.pop_front();
    }
}

void ReadSweep::add(const Measurement& measurement) {
    if (waiting_.empty() && !readings_.empty() && measurement.time_s <= readings_.back()[0])
        return take(measurement);
    waiting_.push_back(measurement);
}

void ReadSweep::take(const Measurement& measurement) {
    while (at_ < readings_.size() && readings_[at_][0] < measurement.time_s) ++at_;
    double hz = readings_[std::min(at_, readings_.size() - 1)][1];
    if (at_ > 0 && at_ < readings_.size()) {
        const auto [from_s, from_hz] = readings_[at_ - 1];
        const auto [to_s, to_hz] = readings_[at_];
        hz = from_hz * std::pow(to_hz / from_hz, (measurement.time_s - from_s) / (to_s - from_s));
    }
    // As it comes from the campaign's stages: angles and force are good together.
    Measurement one = measurement;
    one.angles_good = one.force_good = measurement.angles_good && measurement.force_good;
    blocks_.add(one, hz);
}

Sweep ReadSweep::finish() {
    if (!readings_.empty())
        for (const Measurement& measurement : waiting_) take(measurement);
    waiting_.clear();
    return blocks_.finish();
}

}  // namespace vibrig::estimator::spectrum
