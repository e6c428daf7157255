#include "daemon/interlock/interlock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <utility>

#include "estimator/filter/angles.hpp"

namespace vibrig::rt {

using drivers::Channel;
using drivers::Time;

const char* text_of(Trip trip) noexcept { return condition_of(trip).text; }

void ReactionHistogram::add(Time taken) noexcept {
    const double ms = drivers::to_seconds(taken) * 1e3;
    const auto bound = std::ranges::lower_bound(kBounds_ms, ms);
    ++count_[static_cast<std::size_t>(bound - kBounds_ms.begin())];
    sum_ += taken;
    Time largest = largest_.load();
    while (taken > largest && !largest_.compare_exchange_weak(largest, taken)) {
    }
}

ReactionHistogram::Counts ReactionHistogram::counts() const noexcept {
    Counts counts;
    for (std::size_t i = 0; i < counts.count.size(); ++i) counts.count[i] = count_[i].load();
    counts.sum_ms = drivers::to_seconds(sum_.load()) * 1e3;
    counts.largest_ms = drivers::to_seconds(largest_.load()) * 1e3;
    return counts;
}

Interlock::Interlock(drivers::Shaker& shaker, drivers::Waiter& control, Limits limits)
    : shaker_(shaker),
      control_(control),
      table_g_(limits.table_g),
      platform_age_(limits.platform_age),
      thermometer_(limits.thermometer),
      rules_(std::move(limits.rules)),
      transmission_(limits.transmission),
      frequency_hz_(limits.witness.frequency_hz),
      rate_hz_(1 / drivers::to_seconds(limits.witness.sample_period)),
      seconds_(limits.witness.frequency_hz),
      witness_(limits.witness) {
    std::erase_if(rules_, [](const Rule& rule) { return rule.reaction == Reaction::off; });
    if (rules_.size() > kMostRules) rules_.resize(kMostRules);
    mismatches_ = shaker_.counters().read_back_mismatches;
    for (const auto& one : limits.random) random_.emplace_back(one);
    bands_needed_ =
        !std::ranges::all_of(random_, [](const RandomWitness& one) { return one.fast(); });
}

void Interlock::command(double table_g, const std::array<double, 3>& position_deg) noexcept {
    for (std::size_t i = 0; i < 3; ++i)
        position_rad_[i].store(position_deg[i] * estimator::kRadPerDeg);
    position_known_.store(true);
    commanded_g_.store(table_g);
}

void Interlock::trip(Trip cause, std::size_t row, double value, std::uint8_t channel) noexcept {
    const Tripped mine{cause, static_cast<std::uint8_t>(row), channel, ++trips_,
                       static_cast<float>(value)};
    // Who sees the trip finds its stop ordered, however long this thread is away in between. To
    // order it twice, where two causes come at once, stops no less.
    shaker_.stop_now();
    Tripped other = tripped_.load();
    do {
        if (other) return;  // the first cause stays
    } while (!tripped_.compare_exchange_weak(other, mine));
    control_.notify();
}

void Interlock::judge(By by, Trip trip, bool wrong, Time now) noexcept {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].condition == trip) judge_row(by, i, wrong, wrong ? 1 : 0, now);
    }
}

void Interlock::judge(By by, Trip trip, double value, Time now) noexcept {
    const bool below = condition_of(trip).below;
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].condition != trip) continue;
        // A NaN is wrong either way.
        const bool good = below ? value >= rules_[i].limit : value <= rules_[i].limit;
        judge_row(by, i, !good, value, now);
    }
}

void Interlock::judge(Trip trip, const AmplitudeWitness::Verdict::Finding& finding,
                      Time now) noexcept {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].condition != trip) continue;
        judge_row(By::sample, i, finding.wrong, finding.value_g, now,
                  static_cast<std::uint8_t>(finding.channel));
    }
}

void Interlock::judge_row(By by, std::size_t row, bool wrong, double value, Time now,
                          std::uint8_t channel) noexcept {
    State& state = states_[row];
    state.present.store(value);
    std::atomic<Time>& since = state.since[static_cast<std::size_t>(by)];
    const Rule& rule = rules_[row];
    if (!wrong) {
        since = 0;
        // The other thread may see it otherwise.
        if (!rule.latched && state.met() && state.raised.exchange(false)) control_.notify();
        return;
    }
    now = std::max<Time>(now, 1);  // 0 says that the condition is met
    if (since.load() == 0) since = now;
    if (now - since.load() < drivers::from_seconds(rule.dwell_s)) return;
    if (rule.reaction == Reaction::abort && !tripped_.load()) {
        if (by == By::sample && arrived_ != 0) stop_asked_.store(arrived_);
        trip(rule.condition, row, value, channel);
    }
    if (!state.raised.load()) {
        state.value.store(value);
        state.raised.store(true);
        control_.notify();
    }
}

/// What is not watched any more is not wrong for any time.
void Interlock::forget(By by, Guard above) noexcept {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        const Guard from = condition_of(rules_[i].condition).from;
        if (from <= above) continue;
        states_[i].since[static_cast<std::size_t>(by)] = 0;
        states_[i].present.store(std::numeric_limits<double>::quiet_NaN());
        if (!rules_[i].latched && states_[i].met() && states_[i].raised.exchange(false))
            control_.notify();
    }
}

void Interlock::check(const drivers::Sample& sample,
                      const drivers::PlatformStatus& platform) noexcept {
    const Time now = sample_time_ = sample.time;
    const Guard guard = follow_guard();
    table_bound_ = sample.of(Channel::table_accel) != drivers::Quality::unbound;
    if (seconds_.add(sample)) {
        MeanMotion second = seconds_.mean();
        // A second of random vibration, or of one that goes through multiples of the rate, has a
        // mean of its own.
        second.good = second.good && !(guard == Guard::excitation && (at_random() || sweeping()));
        second_.publish(second);
    }
    if (guard == Guard::excitation) {
        judge(By::sample, Trip::loop_open, !platform.loop_closed || platform.loop_was_open, now);
        judge(By::sample, Trip::platform_fault, platform.fault || platform.had_fault, now);
        check_witnesses(sample);
        judge(By::sample, Trip::over_amplitude,
              verdict_.over_limit.wrong || table_beyond_limit(sample), now);
        check_motion(sample);
        if (const double nis = nis_.load(); nis != 0)
            judge(By::sample, Trip::filter_divergence, nis, now);
    }
    // One that has never spoken may be late, but not by then.
    if (platform.temperature_time > 0 || (thermometer_ && guard == Guard::excitation))
        judge(By::sample, Trip::temperature,
              platform.knows_temperature(now) ? platform.temperature_c
                                              : std::numeric_limits<double>::quiet_NaN(),
              now);
    if (const double free_mb = disk_free_mb_.load(); free_mb >= 0)
        judge(By::sample, Trip::disk, free_mb, now);
    judge(By::sample, Trip::recording, recording_degraded_.load(), now);
    judge(By::sample, Trip::server, server_stuck_.load(), now);
}

/// One reading of the table. Of random vibration single values go beyond three sigma all the time,
/// to which its level was checked; beyond six hardly ever. One that is out of its range twice
/// within a moment is an overload: once it may be a bit that fell over.
bool Interlock::table_beyond_limit(const drivers::Sample& sample) noexcept {
    constexpr double kHardlyEver = 6.1;  // sigmas, once in 1e9
    const Time moment =
        std::max(100 * drivers::kMillisecond, drivers::from_seconds(2.5 / rate_hz_));
    const double limit_g =
        at_random()
            ? std::max(table_g_, kHardlyEver * std::max(commanded_.start_g, commanded_.target_g))
            : table_g_;
    const bool beyond = !(std::abs(sample.table_accel) <= limit_g);
    const auto quality = sample.of(Channel::table_accel);
    if (quality == drivers::Quality::good && beyond) return true;
    // What is no number comes as 0. A peak of random vibration may be beyond a narrow range.
    if (quality == drivers::Quality::out_of_range &&
        (!at_random() || beyond || sample.table_accel == 0)) {
        if (out_of_range_at_ != 0 && sample.time - out_of_range_at_ <= moment)
            out_of_range_again_ = sample.time;
        out_of_range_at_ = sample.time;
    }
    return out_of_range_again_ != 0 && sample.time - out_of_range_again_ <= moment;
}

void Interlock::follow_ramp(const drivers::Sample& sample) noexcept {
    const std::uint64_t before = commanded_.number;
    commanded_ = ramp_.read();
    if (commanded_.random > random_.size()) commanded_.random = 0;
    if (commanded_.number != before) {
        controller_began_ = 0;
        const double hz = commanded_.frequency_hz > 0 ? commanded_.frequency_hz : frequency_hz_;
        if (commanded_.sweep.any())
            witness_.follow(commanded_.sweep);
        else
            witness_.retune(hz);
        seconds_.retune(hz);
        if (commanded_.random > 0 && commanded_.target_g > commanded_.start_g) {
            RandomWitness& witness = random_[commanded_.random - 1U];
            if (commanded_.start_g == 0) witness.begin();
            motion_.begin(witness.time_for_tilt_s(commanded_.target_g * commanded_transmission()));
            verdict_ = {};
        }
    }
    const Time now = std::max(sample.time, now_);
    if (controller_began_ == 0 && !shaker_.busy() && !shaker_.stop_pending())
        controller_began_ = std::max(now, commanded_.begin);
}

bool Interlock::stands_in_samples(Time at) const noexcept {
    constexpr double kFast_hz = 2;  // with a mean over two seconds
    return std::abs(std::remainder(commanded_.sweep.hz(at), rate_hz_)) < kFast_hz;
}

void Interlock::check_random(const drivers::Sample& sample) noexcept {
    const bool steady = commanded_g_.load() > 0;
    const auto found =
        random_[commanded_.random - 1U].add(sample, {commanded_, steady, commanded_transmission()});
    for (std::size_t i = 0; i < 2; ++i) seen_g_[i].store(found.seen_g[i]);
    const bool complete = witness_.add(sample);
    if (proving_.load()) return;
    if (complete) {
        verdict_ = witness_.verdict_at_random({commanded_, controller_began_, sample.time, steady,
                                               commanded_transmission(), table_g_});
        judge(Trip::stuck, verdict_.stuck, sample.time);
    }
    judge(Trip::amplitude_witness,
          found.off_command.wrong ? found.off_command : verdict_.off_command, sample.time);
}

void Interlock::check_witnesses(const drivers::Sample& sample) noexcept {
    follow_ramp(sample);
    if (at_random()) return check_random(sample);
    if (!witness_.add(sample)) return;
    verdict_ = witness_.verdict({commanded_, controller_began_, std::max(sample.time, now_),
                                 commanded_g_.load() > 0, commanded_transmission(), table_g_});
    for (std::size_t i = 0; i < 2; ++i) seen_g_[i].store(verdict_.seen_g[i]);
    judge(Trip::over_armed, verdict_.over_armed, sample.time);
    if (proving_.load()) return;
    judge(Trip::stuck, verdict_.stuck, sample.time);
    judge(Trip::amplitude_witness, verdict_.off_command, sample.time);
}

void Interlock::check_motion(const drivers::Sample& sample) noexcept {
    if (sample.angles_good() && position_known_.load()) {
        double farthest = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            const double off =
                std::remainder(sample.angle[i] - position_rad_[i].load(), 2 * std::numbers::pi);
            farthest = std::isnan(off) ? off : std::max(farthest, std::abs(off));
        }
        judge(By::sample, Trip::gimbal_off, farthest * estimator::kDegPerRad, sample.time);
    }
    if (!sample.force_good()) return;
    // Samples near a multiple of the rate show a vibration as a force that stands, which is none.
    if (sweeping() && stands_in_samples(sample.time)) {
        motion_stood_ = true;
        return;
    }
    if (std::exchange(motion_stood_, false)) motion_.begin();
    motion_.add(sample);
    // A share of a motion that is only just beginning or ending means nothing.
    if (const double share = motion_.cross_share(); share >= 0 && commanded_g_.load() > 0)
        judge(By::sample, Trip::cross_axis, share, sample.time);
    if (const double tilt = motion_.tilt_deg(); !(tilt < 0))
        judge(By::sample, Trip::tilt, tilt, sample.time);
}

/// Another thread may trip between two samples, and the control thread end the excitation before
/// the next one.
void Interlock::keep_contradiction() noexcept {
    const Tripped trip = tripped_.load();
    if (trip == kept_for_) return;
    kept_for_ = trip;
    const bool judged = trip && sampled_under_ == Guard::excitation;
    at_trip_ = judged ? verdict_.contradicts : std::array<bool, 2>{};
}

Guard Interlock::follow_guard() noexcept {
    const Guard guard = guard_.load();
    keep_contradiction();  // after that: who sees what a trip has ended sees the trip
    if (guard == Guard::excitation && sampled_under_ != Guard::excitation) {
        motion_.begin();
        witness_.begin();
        verdict_ = {};
        loss_ = {};
        out_of_range_at_ = out_of_range_again_ = 0;
    }
    if ((guard == Guard::excitation) != (sampled_under_ == Guard::excitation))
        seconds_.begin(guard == Guard::excitation);
    if (guard < sampled_under_) forget(By::sample, guard);
    if (guard < Guard::excitation && sampled_under_ == Guard::excitation)
        for (auto& seen : seen_g_) seen.store(-1);
    sampled_under_ = guard;
    return guard;
}

void Interlock::check_ages(const drivers::SampleAssembler& assembler, Time now) noexcept {
    now_ = now;
    const Guard guard = follow_guard();
    if (guard == Guard::excitation) {
        bool stale = false;
        for (const auto c : {Channel::outer, Channel::inner, Channel::azimuth, Channel::accel_x,
                             Channel::accel_y, Channel::accel_z}) {
            stale = stale || assembler.stale(c, now);
        }
        // Without it the amplitude has one witness less.
        stale = stale || (table_bound_ && assembler.stale(Channel::table_accel, now));
        judge(By::sample, Trip::stale_channel, stale, now);
        judge(By::sample, Trip::stale_platform, now - assembler.platform().time > platform_age_,
              now);
        const auto& counters = assembler.counters();
        loss_.add(now, counters.samples, counters.incomplete + counters.invalid, counters.gaps);
        judge(By::sample, Trip::frame_loss, loss_.percent(), now);
    }
    // Of those outside, whether samples come or not.
    judge(By::sample, Trip::guard_stop, guard_stopped_.load(), now);
    judge(By::sample, Trip::horn, horn_silent_.load(), now);
    if (guard < Guard::armed) return;
    judge(By::sample, Trip::guard_lost, guard_lost_.load(), now);
    judge(By::sample, Trip::shaker_lost, !unlinked_.load() && !shaker_.reading().valid, now);
}

void Interlock::lost_bus() noexcept {
    if (at_least(Guard::armed)) judge(By::sample, Trip::can_lost, true, drivers::steady_now());
}

/// Of every reply, also of one whose amplitude is no number: a controller whose power stage was
/// cut may have none, and that it was is what the other registers say.
void Interlock::check(const drivers::ShakerReading& reading) noexcept {
    const Guard guard = guard_.load();
    if (guard < read_under_) forget(By::read_back, guard);
    read_under_ = guard;
    const Time now = reading.time;
    judge(By::read_back, Trip::uncommanded,
          reading.running && guard < Guard::excitation && !shaker_.stop_pending(), now);
    const std::uint64_t mismatches = shaker_.counters().read_back_mismatches;
    const bool mismatch = std::exchange(mismatches_, mismatches) != mismatches;
    if (guard < Guard::armed) return;
    judge(By::read_back, Trip::emergency_stop, reading.emergency_stop_open, now);
    judge(By::read_back, Trip::shaker_fault,
          !proving_.load() && (reading.fault != 0 || reading.state == drivers::kShakerFault), now);
    judge(By::read_back, Trip::over_amplitude, !(reading.measured_g <= table_g_), now);
    judge(By::read_back, Trip::read_back, mismatch, now);
    judge(By::read_back, Trip::watchdog_changed,
          reading.watchdog == drivers::WatchdogTimeout::changed, now);
    const bool random = reading.random && reading.random->random;
    judge(By::read_back, Trip::abort_bands,
          guard == Guard::excitation && bands_needed_ && random && reading.running &&
              !reading.random->bands_armed,
          now);
    // Of random vibration a read-back is a mean that strays: the accelerometers' bands judge it.
    if (const double commanded = commanded_g_.load(); commanded > 0 && !random && reading.valid) {
        judge(By::read_back, Trip::amplitude_off,
              std::abs(20 * std::log10(reading.measured_g / commanded)), now);
    }
}

void Interlock::no_growth() noexcept {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        const Trip trip = rules_[i].condition;
        if (trip == Trip::motion_in_step || trip == Trip::cross_growth)
            judge_row(By::read_back, i, false, std::numeric_limits<double>::quiet_NaN(), 0);
    }
}

/// It has lasted already: no row's dwell is waited for.
void Interlock::uncommanded() noexcept {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].condition != Trip::uncommanded) continue;
        states_[i].value.store(1);
        states_[i].raised.store(true);
        trip(Trip::uncommanded, i, 1, drivers::kChannels);
    }
}

void Interlock::stop_written() noexcept {
    if (const Time asked = stop_asked_.exchange(0); asked != 0)
        reactions_.add(drivers::steady_now() - asked);
}

std::string Interlock::text_of(const Tripped& tripped) const {
    const Condition& condition = condition_of(tripped.cause);
    std::array<char, 96> words{};
    const auto channel = static_cast<Channel>(tripped.channel);
    const auto value = static_cast<double>(tripped.value);
    if (tripped.cause == Trip::stuck && tripped.channel < drivers::kChannels) {
        std::snprintf(words.data(), words.size(), ": %s, %.3g g expected",
                      drivers::name_of(channel), value);
        return std::string(condition.text) + words.data();
    }
    if (tripped.channel < drivers::kChannels) {
        const Ramp ramp = ramp_.read();
        const char* who = channel == Channel::table_accel ? "table accelerometer" : "platform";
        if (value < 0) {
            std::snprintf(words.data(), words.size(),
                          ": %s does not know the amplitude, %.3g g%s commanded", who,
                          ramp.target_g, ramp.random > 0 ? " rms" : "");
            return std::string(condition.text) + words.data();
        }
        const bool armed = tripped.cause == Trip::over_armed;
        std::snprintf(words.data(), words.size(), ": %s %.3g g%s at the table, %.3g g %s", who,
                      value, ramp.random > 0 ? " rms" : "", armed ? ramp.armed_g : ramp.target_g,
                      armed ? "armed" : "commanded");
        return std::string(condition.text) + words.data();
    }
    if (!condition.has_limit() || tripped.row >= rules_.size() ||
        rules_[tripped.row].condition != tripped.cause)
        return condition.text;
    const double limit = rules_[tripped.row].limit;
    if (std::isnan(value))
        std::snprintf(words.data(), words.size(), ": not known, limit %.4g %s", limit,
                      condition.unit);
    else
        std::snprintf(words.data(), words.size(), ": %.4g, limit %.4g %s", value, limit,
                      condition.unit);
    return std::string(condition.text) + words.data();
}

std::string Interlock::name_of(const Tripped& tripped) const {
    if (!tripped) return {};
    return tripped.row < rules_.size() && rules_[tripped.row].condition == tripped.cause
               ? rules_[tripped.row].name
               : condition_of(tripped.cause).name;
}

void Interlock::acknowledge(const Tripped& handled) noexcept {
    Tripped now = tripped_.load();
    do {
        if (!now || !(now == handled)) return;
    } while (!tripped_.compare_exchange_weak(now, Tripped{}));
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].reaction == Reaction::abort) states_[i].raised.store(false);
    }
}

bool Interlock::acknowledge_alarm(const std::string& name) noexcept {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
        if (rules_[i].name == name && rules_[i].reaction == Reaction::alarm)
            return states_[i].raised.exchange(false);
    }
    return false;
}

double Interlock::least_limit(Trip condition) const noexcept {
    double least = std::numeric_limits<double>::infinity();
    for (const Rule& rule : rules_)
        if (rule.condition == condition) least = std::min(least, rule.limit);
    return least;
}

Interlock::RowState Interlock::row(std::size_t i) const noexcept {
    return {&rules_[i], states_[i].raised.load(), states_[i].value.load(),
            states_[i].present.load()};
}

}  // namespace vibrig::rt
