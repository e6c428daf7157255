#include "tests/plant/shaker_controller.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "proto/register_map.hpp"

namespace vibrig::plant {
namespace {

const proto::ShakerRegisters kMap;
constexpr double kWatchdogStop = 0.5;    ///< s, the table comes down on a watchdog trip
constexpr double kEmergencyStop = 0.05;  ///< s, power amplifier cut off
constexpr double kRandomStop = 0.05;     ///< s, there is no way down through the levels
// The controller's own abort bands: of the mean square over a second, for so long, once it has one.
constexpr double kMean_s = 1, kBands = 2, kBands_s = 0.3, kSettled_s = 3;
constexpr std::int16_t kLeastLevel = -600, kMostLevel = 60;  // 0.1 dB
constexpr double kMetrePerSecond2 = 9.80665;

std::uint32_t joined(std::span<const std::uint16_t> words, std::size_t address) {
    return (static_cast<std::uint32_t>(words[address]) << 16) | words[address + 1];
}
double value(std::span<const std::uint16_t> words, const proto::Register& reg) {
    const std::uint32_t raw =
        reg.type == proto::RegisterType::u32 ? joined(words, reg.address) : words[reg.address];
    return raw * reg.scale;
}
void split(std::span<std::uint16_t> words, std::size_t address, double raw) {
    const auto whole = static_cast<std::uint32_t>(std::llround(raw));
    words[address] = static_cast<std::uint16_t>(whole >> 16);
    words[address + 1] = static_cast<std::uint16_t>(whole & 0xffff);
}

}  // namespace

double ShakerController::frequency_hz() const noexcept { return value(holding_, kMap.frequency); }
double ShakerController::set_point_g() const noexcept { return value(holding_, kMap.amplitude); }
double ShakerController::ramp_s() const noexcept { return value(holding_, kMap.ramp_time); }

double ShakerController::amplitude_g() const noexcept {
    if (outside_g_) return emergency_stop_open_ ? 0 : *outside_g_;
    if (lies_.dead_table) return 0;
    const double unit = lies_.unit_rms    ? std::numbers::sqrt2
                        : lies_.unit_mps2 ? 1 / kMetrePerSecond2
                                          : 1;
    const double level = played() != nullptr ? std::pow(10, lies_.profile_level_wrong / 20) : 1;
    return lies_.amplitude_scaled * unit * level * std::max(drive_g_, held_g_);
}

const ShakerProfile* ShakerController::of_number(std::uint16_t number) const noexcept {
    const auto found = std::ranges::find(profiles_, number, &ShakerProfile::number);
    return found == profiles_.end() ? nullptr : &*found;
}

const ShakerProfile* ShakerController::played() const noexcept {
    if (holding_[kMode] != 1) return nullptr;
    return of_number(lies_.wrong_profile.value_or(holding_[kProfileNumber]));
}

double ShakerController::profile_level_db() const noexcept {
    return 0.1 * std::bit_cast<std::int16_t>(holding_[kProfileLevel]);
}

double ShakerController::commanded_g() const noexcept {
    const ShakerProfile* profile = played();
    return profile == nullptr ? set_point_g()
                              : profile->rms_g() * std::pow(10, profile_level_db() / 20);
}

/// What chooses the vibration changes only with the table at rest.
bool ShakerController::may_be(const std::array<std::uint16_t, kHolding>& next) const noexcept {
    const bool moving = state_ != ShakerState::idle || drive_g_ > 0;
    const auto changed = [&](std::size_t at) { return next[at] != holding_[at]; };
    bool other = false;
    for (std::size_t at = kMode; at < kHolding; ++at) other = other || changed(at);
    if (moving && other) return false;
    const auto level = std::bit_cast<std::int16_t>(next[kProfileLevel]);
    if (next[kMode] > 2 || level < kLeastLevel || level > kMostLevel) return false;
    const auto may_sweep = [&](std::size_t at) {
        const double hz = 1e-3 * joined(next, at);
        return hz >= 1 && hz <= 200;
    };
    if (next[kMode] == 2 && !(may_sweep(kSweepFrom) && may_sweep(kSweepTo) && next[kSweepRate] > 0))
        return false;
    return (next[kProfileNumber] == 0 && next[kMode] != 1) ||
           of_number(next[kProfileNumber]) != nullptr;
}

ShakerController::Answer ShakerController::write(std::size_t address,
                                                 std::span<const std::uint16_t> values) noexcept {
    if (values.empty() || address + values.size() > kHolding) return Answer::illegal_address;
    std::array<std::uint16_t, kHolding> next = holding_;
    std::copy(values.begin(), values.end(), next.begin() + static_cast<std::ptrdiff_t>(address));

    const double frequency = value(next, kMap.frequency);
    const double amplitude = value(next, kMap.amplitude);
    const bool run = next[kMap.run.address] != 0;
    const bool was_running = holding_[kMap.run.address] != 0;
    const bool moving = state_ != ShakerState::idle || drive_g_ > 0;
    if (frequency != frequency_hz() && (moving || frequency < 1 || frequency > 200))
        return Answer::illegal_value;
    if (amplitude > limit_g_ || !may_be(next)) return Answer::illegal_value;
    if (next[kMap.run.address] > 1) return Answer::illegal_value;
    if (run && !was_running &&
        (emergency_stop_open_ || state_ == ShakerState::fault || drive_g_ > 0)) {
        return Answer::illegal_value;
    }

    const bool will_sweep = next[kMode] == 2;
    if (!(will_sweep && moving))
        commanded_hz_ = will_sweep ? 1e-3 * joined(next, kSweepFrom) : frequency;
    if (!lies_.frequency_ignored && !(will_sweep && moving))
        table_hz_ = will_sweep ? 1e-3 * joined(next, kSweepFrom) : frequency;
    if (lies_.timeout_register) next[kMap.watchdog_timeout.address] = *lies_.timeout_register;
    if (next[kMap.watchdog->address] != holding_[kMap.watchdog->address]) since_feed_s_ = 0;
    const double old_amplitude = set_point_g();
    holding_ = next;
    if (run && !was_running) {
        since_feed_s_ = 0;
        state_ = ShakerState::ramping;
        outside_bands_s_ = at_level_s_ = aborted_ = 0;
        swept_s_ = 0;
        ramp_to(commanded_g(), ramp_s());
    } else if (!run && was_running) {
        if (!lies_.ack_without_stop)
            stop(ShakerState::stopping, played() != nullptr ? kRandomStop : ramp_s());
    } else if (run && amplitude != old_amplitude && played() == nullptr &&
               state_ != ShakerState::fault) {
        state_ = ShakerState::ramping;
        ramp_to(amplitude, ramp_s());
    } else if (!run && state_ == ShakerState::fault && drive_g_ == 0 && !emergency_stop_open_ &&
               address <= kMap.run.address && address + values.size() > kMap.run.address) {
        state_ = ShakerState::idle;  // run = 0 written at rest acknowledges
        faults_ = 0;
    }
    return Answer::accepted;
}

std::array<std::uint16_t, ShakerController::kInput> ShakerController::input() const noexcept {
    std::array<std::uint16_t, kInput> words{};
    words[kMap.state.address] = static_cast<std::uint16_t>(state_);
    words[kMap.fault.address] = faults_;
    words[kMap.emergency_stop.address] = emergency_stop_open_ && !lies_.estop_unseen ? 1 : 0;
    double measured = lies_.dead_table ? 0 : drive_g_;
    if (lies_.readback_echo) measured = holding_[kMap.run.address] != 0 ? set_point_g() : 0;
    split(words, kMap.measured_amplitude.address, measured / kMap.measured_amplitude.scale);
    const ShakerProfile* profile = played();
    const std::uint32_t checksum = profile != nullptr ? profile->checksum() : 0;
    words[kProfileChecksum] = static_cast<std::uint16_t>(checksum >> 16);
    words[kProfileChecksum + 1] = static_cast<std::uint16_t>(checksum);
    split(words, kMeasuredRms, std::sqrt(mean_square_) / 1e-4);
    words[kControlState] = control_state();
    split(words, kActualFrequency, 1e3 * (lies_.actual_as_told ? commanded_hz_ : table_hz_));
    const auto put = [&words](std::size_t at, double number) {
        const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(number));
        words[at] = static_cast<std::uint16_t>(bits >> 16);
        words[at + 1] = static_cast<std::uint16_t>(bits);
    };
    for (std::size_t i = 0; i < psd_.size(); ++i) {
        put(kPsdBlock + 4 * i, psd_[i][0]);
        put(kPsdBlock + 4 * i + 2, lies_.psd_nan && i == psd_.size() / 2
                                       ? std::numeric_limits<double>::quiet_NaN()
                                       : lies_.psd_scaled * psd_[i][1]);
    }
    return words;
}

void ShakerController::measured(std::span<const double> power, double line_hz) {
    constexpr std::size_t kMostBins = kPsdPairs - 60;
    const ShakerProfile* profile = played();
    if (profile == nullptr || power.empty() || (lies_.psd_stale && !psd_.empty())) return;
    const auto first = static_cast<std::size_t>(std::floor(profile->psd.front().first / line_hz)),
               last = std::min(
                   static_cast<std::size_t>(std::ceil(profile->psd.back().first / line_hz)) + 1,
                   power.size());
    if (last <= first + 1) return;
    const std::size_t bin = (last - first + kMostBins - 1) / kMostBins;
    const double level = commanded_g() * commanded_g();
    // A line at an end is within the profile by a part of its width.
    const double from = profile->psd.front().first, to = profile->psd.back().first;
    psd_.clear();
    for (std::size_t k = first; k < last; k += bin) {
        const std::size_t end = std::min(k + bin, last);
        double sum = 0;
        for (std::size_t i = k; i < end; ++i) sum += power[i];
        const double low = std::max(from, (static_cast<double>(k) - 0.5) * line_hz),
                     high = std::min(to, (static_cast<double>(end) - 0.5) * line_hz);
        if (high > low) psd_.push_back({(low + high) / 2, level * sum / (high - low)});
    }
    // What it is at the very ends, so that nothing is left out.
    psd_.insert(psd_.begin(), {from, psd_.front()[1]});
    psd_.push_back({to, psd_.back()[1]});
}

std::uint16_t ShakerController::control_state() const noexcept {
    if (played() == nullptr) return 0;
    const std::uint16_t armed = lies_.no_abort_bands ? 0 : kBandsArmed;
    const auto of = [&](RandomState state) {
        return static_cast<std::uint16_t>(static_cast<std::uint16_t>(state) | armed);
    };
    if (aborted_ != 0) return static_cast<std::uint16_t>(of(RandomState::aborted) | aborted_ << 8);
    if (state_ == ShakerState::ramping) return of(RandomState::levelling);
    return of(state_ == ShakerState::running ? RandomState::at_level : RandomState::idle);
}

/// The controller's own accelerometer: what the drive does, or whoever else has the table.
void ShakerController::watch_bands(double dt_s) noexcept {
    const double now = outside_g_ ? *outside_g_ * *outside_g_ : felt_ * drive_g_ * drive_g_;
    mean_square_ += (now - mean_square_) * (1 - std::exp(-dt_s / kMean_s));
    if (drive_g_ == 0 && !outside_g_) mean_square_ = 0;
    if (played() == nullptr) return;
    at_level_s_ = state_ == ShakerState::running ? at_level_s_ + dt_s : 0;
    const double over = mean_square_ / (commanded_g() * commanded_g());
    const bool off = at_level_s_ > kSettled_s && (over > kBands || over < 1 / kBands);
    outside_bands_s_ = off ? outside_bands_s_ + dt_s : 0;
    if (outside_bands_s_ < kBands_s || lies_.no_abort_bands) return;
    aborted_ = over > 1 ? kAbortAbove : kAbortBelow;
    trip(kFaultLimit, kRandomStop);
}

/// Exponentially; a driver that ignores its frequency sweeps through nothing.
void ShakerController::sweep(double dt_s) noexcept {
    if (!sweeps() || state_ != ShakerState::running) return;
    swept_s_ += dt_s;
    if (swept_s_ < kSweepRests_s) return;
    const double octaves = 0.01 * holding_[kSweepRate] * dt_s / 60;
    commanded_hz_ = swept(commanded_hz_, octaves);
    if (!lies_.frequency_ignored) table_hz_ = swept(table_hz_, lies_.sweep_rate_scaled * octaves);
}

/// Within what the drive can do.
double ShakerController::swept(double hz, double octaves) const noexcept {
    constexpr double kLeast_hz = 1, kMost_hz = 200;
    const double to_hz = 1e-3 * joined(holding_, kSweepTo);
    if (octaves < 0)
        return std::clamp(to_hz > hz ? hz * std::exp2(octaves) : hz / std::exp2(octaves), kLeast_hz,
                          kMost_hz);
    return to_hz > hz ? std::min(to_hz, hz * std::exp2(octaves))
                      : std::max(to_hz, hz / std::exp2(octaves));
}

void ShakerController::open_emergency_stop(bool open) noexcept {
    const bool was_open = std::exchange(emergency_stop_open_, open);
    if (open == was_open) return;
    if (open && !lies_.estop_contact_only) trip(kFaultEmergencyStop, kEmergencyStop);
    if (open || !lies_.estop_restarts) return;
    faults_ = 0;
    since_feed_s_ = 0;
    holding_[kMap.run.address] = 1;
    state_ = ShakerState::ramping;
    ramp_to(commanded_g(), ramp_s());
}

void ShakerController::lie(const ShakerLies& lies) noexcept {
    const bool broke = lies.latched_fault && !lies_.latched_fault;
    lies_ = lies;
    if (broke) trip(kFaultInternal, kWatchdogStop);
    if (lies_.timeout_register) holding_[kMap.watchdog_timeout.address] = *lies_.timeout_register;
    if (!lies_.stuck_contactor) held_g_ = 0;
    // What was only said to be stopped is stopped at last.
    const bool excited = state_ == ShakerState::ramping || state_ == ShakerState::running;
    if (!lies_.ack_without_stop && excited && holding_[kMap.run.address] == 0)
        stop(ShakerState::stopping, ramp_s());
}

void ShakerController::ramp_to(double target_g, double time_s) noexcept {
    target_g_ = target_g;
    slope_g_per_s_ = std::abs(target_g - drive_g_) / std::max(time_s, 1e-3);
}

void ShakerController::trip(std::uint16_t fault, double stop_s) noexcept {
    faults_ |= fault;
    if (played() != nullptr && aborted_ == 0) aborted_ = kAbortStopped;
    holding_[kMap.run.address] = 0;
    stop(ShakerState::fault, stop_s);
}

void ShakerController::stop(ShakerState state, double time_s) noexcept {
    state_ = state;
    if (lies_.stuck_contactor) held_g_ = std::max(held_g_, drive_g_);
    ramp_to(0, time_s);
}

void ShakerController::advance(double dt_s) noexcept {
    const bool excited = state_ == ShakerState::ramping || state_ == ShakerState::running;
    const double timeout = lies_.timeout_scaled * value(holding_, kMap.watchdog_timeout);
    const bool stands = linked_ ? lies_.timeout_if_unlinked : lies_.timeout_if_linked;
    if (!stands) since_feed_s_ += dt_s;
    if (excited && timeout > 0 && !lies_.timeout_ignored && since_feed_s_ > timeout)
        trip(kFaultWatchdog, kWatchdogStop);

    // An amplifier without power is not slow.
    const double slow = emergency_stop_open_ ? 1 : lies_.slow_ramp;
    if (emergency_stop_open_) held_g_ = std::min(held_g_, drive_g_);
    const double step = slope_g_per_s_ * dt_s / slow;
    const double gap = target_g_ - drive_g_;
    // A rounding error must not cost a further tick.
    drive_g_ = std::abs(gap) <= step * (1 + 1e-9) ? target_g_ : drive_g_ + std::copysign(step, gap);
    if (drive_g_ == target_g_) {
        if (state_ == ShakerState::ramping) state_ = ShakerState::running;
        if (state_ == ShakerState::stopping) state_ = ShakerState::idle;
    }
    highest_g_ = std::max(highest_g_, amplitude_g());
    watch_bands(dt_s);
    sweep(dt_s);
    const double omega = 2 * std::numbers::pi * table_hz_;
    const ShakerProfile* profile = played();
    const double peak_mm = profile != nullptr
                               ? 3 * amplitude_g() * profile->rms_mm() / profile->rms_g()
                               : 1e3 * amplitude_g() * kMetrePerSecond2 / (omega * omega);
    if (peak_mm > limit_mm_ && state_ != ShakerState::fault) trip(kFaultLimit, kWatchdogStop);
}

}  // namespace vibrig::plant
