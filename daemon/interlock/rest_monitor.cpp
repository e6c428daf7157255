#include "daemon/interlock/rest_monitor.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::rt {

using drivers::Time;

namespace {

constexpr Time kStale = 200 * drivers::kMillisecond;
// A window is summed up no more often: at 1 kHz it is of 500 samples.
constexpr Time kJudgeEvery = 5 * drivers::kMillisecond;
constexpr Time kFewest = 8;  // samples that an rms rests on
// Of the samples of a window so many have to be there: now and then one is lost.
constexpr double kShare = 0.75;
constexpr double kLivesCounts = 2;  // more than the flicker of one that is stuck

// Noise is beyond doubt where each of so many windows of rest has had so much of it.
constexpr int kWindowsOfLife = 20;
constexpr double kLifeCounts = 8;
constexpr double kTurns_g = 2e-3;  // from one window to the next: it is slewed

/// Stillness of one that is doubted says nothing; its motion does.
void take_back(RestWitness& witness, bool doubtful) noexcept {
    if (!doubtful || witness.verdict == RestVerdict::moving) return;
    witness.verdict = RestVerdict::unknown;
    witness.rms_g = 0;
    witness.doubted = true;
}

}  // namespace

RestWindow::RestWindow(Time window, Time sample_period)
    : window_(std::max(window, kFewest * sample_period)),
      sample_period_(drivers::checked_period("rest", sample_period)),
      ring_(static_cast<std::size_t>(window_ / sample_period) + 2) {}

void RestWindow::add(Time time, double value) noexcept {
    if (!std::isfinite(value)) return;
    if (count_ > 0) {
        const Time newest = at(count_ - 1).time;
        if (newest - time > window_) count_ = 0;  // another clock
        if (count_ > 0 && time <= newest) return;
    }
    while (count_ > 0 && (at(0).time < time - window_ || count_ == ring_.size())) {
        first_ = (first_ + 1) % ring_.size();
        --count_;
    }
    ring_[(first_ + count_) % ring_.size()] = {time, value};
    ++count_;
}

RestWitness RestWindow::judge(double limit_g) const noexcept {
    RestWitness witness;
    if (count_ == 0) return witness;
    witness.from = at(0).time;
    witness.to = at(count_ - 1).time;
    const auto due = static_cast<double>(window_) / static_cast<double>(sample_period_);
    if (witness.to - witness.from + 2 * sample_period_ < window_ ||
        static_cast<double>(count_) < kShare * due)
        return witness;
    double mean = 0, square = 0;
    for (std::size_t i = 0; i < count_; ++i) mean += at(i).value;
    mean /= static_cast<double>(count_);
    for (std::size_t i = 0; i < count_; ++i) {
        const double away = at(i).value - mean;
        square += away * away;
    }
    witness.rms_g = std::sqrt(square / static_cast<double>(count_));
    witness.verdict = witness.rms_g < limit_g ? RestVerdict::still : RestVerdict::moving;
    return witness;
}

bool Doubt::settled_by(Time time, std::span<const double> values,
                       std::span<const double> counts_g) noexcept {
    if (!open_) return false;
    const bool anew = from_ == 0 || time - from_ > window_ || time < from_;
    if (anew) from_ = time;
    bool all_move = true;
    for (std::size_t i = 0; i < values.size() && i < kMost; ++i) {
        low_[i] = anew ? values[i] : std::fmin(low_[i], values[i]);
        high_[i] = anew ? values[i] : std::fmax(high_[i], values[i]);
        all_move = all_move && high_[i] - low_[i] > kLivesCounts * counts_g[i];
    }
    open_ = !all_move;
    return all_move;
}

void Liveness::begin_window() noexcept {
    rest_from_ = newest_;
    for (std::size_t i = 0; i < axes_.size(); ++i)
        axes_[i].rest_low = axes_[i].rest_high = newest_value_[i];
}

void Liveness::add(Time time, std::span<const double> values,
                   std::span<const double> counts_g) noexcept {
    const bool anew = newest_ == 0 || time < newest_ || time - newest_ > window_;
    newest_ = time;
    for (std::size_t i = 0; i < values.size() && i < axes_.size(); ++i) {
        Axis& axis = axes_[i];
        const double value = newest_value_[i] = values[i];
        axis.low = std::fmin(axis.low, value);
        axis.high = std::fmax(axis.high, value);
        axis.rest_low = std::fmin(axis.rest_low, value);
        axis.rest_high = std::fmax(axis.rest_high, value);
        if (!anew && axis.high - axis.low <= kLivesCounts * counts_g[i]) continue;
        axis.low = axis.high = value;
        axis.since = time;
    }
    if (anew) begin_window();
}

void Liveness::judged(bool still, std::span<const double> counts_g) noexcept {
    if (!still) {
        for (Axis& axis : axes_) axis.windows = 0;
        begin_window();
        return;
    }
    if (newest_ - rest_from_ < window_) return;
    for (std::size_t i = 0; i < counts_g.size() && i < axes_.size(); ++i) {
        Axis& axis = axes_[i];
        const double noise = axis.rest_high - axis.rest_low;
        const double middle = 0.5 * (axis.rest_high + axis.rest_low);
        const bool turns = std::abs(middle - axis.middle) > kTurns_g + 0.5 * noise;
        axis.middle = middle;
        // Less than before, and more than the flicker of one that is stuck: the noise has become
        // less, as that of a room does by night.
        if (noise > kLivesCounts * counts_g[i] && noise <= kLifeCounts * counts_g[i])
            axis.lived = false;
        axis.windows =
            counts_g[i] > 0 && noise > kLifeCounts * counts_g[i] && !turns ? axis.windows + 1 : 0;
        axis.lived = axis.lived || axis.windows >= kWindowsOfLife;
    }
    begin_window();
}

bool Liveness::lost() const noexcept {
    return std::ranges::any_of(axes_, [this](const Axis& axis) {
        return axis.lived && newest_ - axis.since >= silent_for_;
    });
}

RestMonitor::RestMonitor(const RestSettings& settings, Time sample_period, const Counts& counts_g)
    : limit_g_(settings.limit_g),
      counts_g_(counts_g),
      stale_after_(std::max(kStale, 3 * sample_period)),
      platform_(drivers::from_seconds(settings.window_s), sample_period),
      table_(drivers::from_seconds(settings.window_s), sample_period),
      platform_doubt_(std::max(drivers::from_seconds(settings.window_s), kFewest * sample_period)),
      table_doubt_(platform_doubt_),
      platform_life_(std::max(drivers::from_seconds(settings.window_s), kFewest * sample_period),
                     sample_period),
      table_life_(platform_life_) {}

void RestMonitor::doubt(drivers::Channel channel) noexcept {
    (channel == drivers::Channel::table_accel ? table_doubt_ : platform_doubt_).begin();
}

void RestMonitor::add(const drivers::Sample& sample) noexcept {
    const std::span<const double, 4> counts(counts_g_);
    if (sample.force_good()) {
        const auto& f = sample.force;
        platform_life_.add(sample.time, f, counts.first<3>());
        if (platform_doubt_.settled_by(sample.time, f, counts.first<3>())) platform_.clear();
        platform_.add(sample.time, std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
    }
    const auto quality = sample.of(drivers::Channel::table_accel);
    if (quality == drivers::Quality::good) {
        const double along = sample.table_accel;
        table_life_.add(sample.time, {&along, 1}, counts.last<1>());
        if (table_doubt_.settled_by(sample.time, {&along, 1}, counts.last<1>())) table_.clear();
        table_.add(sample.time, along);
    }
    Rest rest = view_.read();
    const Time judged = std::max(rest.platform.to, rest.table.to);
    if (sample.time > judged && sample.time < judged + kJudgeEvery) return;
    rest.platform = platform_.judge(limit_g_);
    rest.table = table_.judge(limit_g_);
    platform_life_.judged(rest.platform.verdict == RestVerdict::still, counts.first<3>());
    table_life_.judged(rest.table.verdict == RestVerdict::still, counts.last<1>());
    take_back(rest.platform, platform_doubt_.open() || platform_life_.lost());
    take_back(rest.table, table_doubt_.open() || table_life_.lost());
    if (quality == drivers::Quality::unbound) rest.table = {RestVerdict::absent};
    view_.publish(rest);
}

Rest RestMonitor::rest(Time now) const noexcept {
    Rest rest = view_.read();
    for (RestWitness* witness : {&rest.platform, &rest.table}) {
        if (witness->verdict == RestVerdict::absent || now - witness->to <= stale_after_) continue;
        witness->verdict = RestVerdict::unknown;
        witness->rms_g = 0;
    }
    return rest;
}

}  // namespace vibrig::rt
