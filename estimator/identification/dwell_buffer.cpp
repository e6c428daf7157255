#include "estimator/identification/dwell_buffer.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/median.hpp"

namespace vibrig::estimator {

DwellBuffer::DwellBuffer(double span_s, double longest_s, double rate_hz)
    : span_s_(span_s), rate_hz_(rate_hz) {
    readings_.reserve(static_cast<std::size_t>(longest_s * rate_hz) + 1);
    scratch_.reserve(readings_.capacity());
}

void DwellBuffer::clear() noexcept {
    readings_.clear();
    shortest_interval_ = 0;
    wanted_s_ = span_s_;
}

void DwellBuffer::push(const Reading& reading) noexcept {
    if (readings_.size() == readings_.capacity()) return;
    if (!readings_.empty()) {
        const double interval = reading.time_s - last().time_s;
        shortest_interval_ =
            readings_.size() == 1 ? interval : std::min(shortest_interval_, interval);
    }
    readings_.push_back(reading);
}

bool DwellBuffer::full() const noexcept {
    if (static_cast<double>(readings_.size()) > wanted_s_ * rate_hz_) return true;
    if (readings_.size() < 2) return false;
    const double span = last().time_s - readings_.front().time_s + shortest_interval_;
    return span >= wanted_s_ - 1e-6;
}

double DwellBuffer::period(double otherwise) noexcept {
    if (readings_.size() < 2) return otherwise;
    scratch_.clear();
    for (std::size_t i = 1; i < readings_.size(); ++i) {
        scratch_.push_back(readings_[i].time_s - readings_[i - 1].time_s);
    }
    const double typical = median(scratch_);
    // The whole span, in periods, averages the jitter of single stamps.
    const double span = last().time_s - readings_.front().time_s;
    return span / std::max(1.0, std::round(span / typical));
}

bool DwellBuffer::median_angles(Eigen::Vector3d& out) noexcept {
    const auto first = std::find_if(readings_.begin(), readings_.end(),
                                    [](const Reading& r) { return r.angles_good; });
    if (first == readings_.end()) return false;
    for (Eigen::Index k = 0; k < 3; ++k) {
        scratch_.clear();
        for (const Reading& r : readings_) {
            if (r.angles_good) scratch_.push_back(wrap_next_to(r.angles[k], first->angles[k]));
        }
        out[k] = median(scratch_);
    }
    return true;
}

}  // namespace vibrig::estimator
