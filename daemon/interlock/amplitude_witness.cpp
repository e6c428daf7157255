#include "daemon/interlock/amplitude_witness.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::rt {

using drivers::Channel;
using drivers::Quality;
using drivers::Sample;
using drivers::Time;

namespace {

constexpr double kWindow_s = 0.3;
// A window of fewer turns of the alias against zero or half the rate does not tell amplitude from
// phase.
constexpr double kFewestTurns = 0.5;
constexpr int kFewestSamples = 8;
// What is wrong is so for this long: with the window, half a second at most.
constexpr Time kWrongFor = 150 * drivers::kMillisecond;
constexpr Time kLeastSamplesUnknown = 6;  // where they come slowly: one that is lost is no more
constexpr double kFromAlias_hz = 0.05;    // nearer to zero or half the rate nobody could know
constexpr double kStuckCounts = 20;       // of expected vibration
constexpr double kMovesCounts = 2;
constexpr std::size_t kStuckBlocks = 4, kSuspectBlocks = 2;
constexpr double kLevelShare = 0.04;  // sine of what an attitude may be off by
constexpr double kLeastGravity_g = 0.1;

using Vector = std::array<double, 3>;

Vector times(const std::array<Vector, 3>& m, const Vector& v) noexcept {
    Vector out{};
    for (std::size_t i = 0; i < 3; ++i) out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    return out;
}
double dot(const Vector& a, const Vector& b) noexcept {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double window_for(const AmplitudeWitness::Settings& s) {
    const double period = drivers::to_seconds(s.sample_period), half_rate = 0.5 / period;
    const double off = std::abs(std::remainder(s.frequency_hz, half_rate));
    return std::max(
        {kWindow_s, kFewestTurns / std::max(off, kFromAlias_hz), kFewestSamples * period});
}

/// True once it has been wrong for long enough; remembers since when.
bool lasting(bool wrong, Time& since, Time now) noexcept {
    if (!wrong) {
        since = 0;
        return false;
    }
    if (since == 0) since = now;
    return now - since >= kWrongFor;
}

}  // namespace

double Sweep::hz(Time at) const noexcept {
    if (!(octaves_per_s > 0) || at <= begin) return from_hz;
    const double octaves = octaves_per_s * drivers::to_seconds(at - begin);
    return to_hz > from_hz ? std::min(to_hz, from_hz * std::exp2(octaves))
                           : std::max(to_hz, from_hz * std::exp2(-octaves));
}

double Sweep::turns(Time at) const noexcept {
    const double since = drivers::to_seconds(at - begin);
    if (!(octaves_per_s > 0) || since <= 0) return from_hz * since;
    const double rate = (to_hz > from_hz ? 1 : -1) * octaves_per_s * std::numbers::ln2;
    const double lasts = std::log(to_hz / from_hz) / rate;
    const double swept = from_hz * std::expm1(rate * std::min(since, lasts)) / rate;
    return swept + to_hz * std::max(0.0, since - lasts);
}

double Sweep::transmission_at(Time at) const noexcept {
    const double way = std::log(hz(at) / from_hz) / std::log(to_hz / from_hz);
    const double place = std::clamp(way, 0.0, 1.0) * static_cast<double>(kAlong - 1);
    const std::size_t before = std::min(static_cast<std::size_t>(place), kAlong - 2);
    const double share = place - static_cast<double>(before);
    return (1 - share) * transmission[before] + share * transmission[before + 1];
}

double Ramp::at(Time time, Time from) const noexcept {
    if (time <= from) return start_g;
    if (time - from >= duration) return target_g;
    const double share = static_cast<double>(time - from) / static_cast<double>(duration);
    return start_g + share * (target_g - start_g);
}

AmplitudeWitness::AmplitudeWitness(const Settings& settings) : settings_(settings) {
    static_cast<void>(drivers::checked_period("amplitude witness", settings.sample_period));
    set_windows();
}

void AmplitudeWitness::set_windows() noexcept {
    window_ = drivers::from_seconds(window_for(settings_));
    block_ = window_ / static_cast<Time>(LockIn<1>::kBlocks);
    fewest_ = std::max(
        6.0, 0.5 * static_cast<double>(window_) / static_cast<double>(settings_.sample_period));
}

void AmplitudeWitness::retune(double frequency_hz) noexcept {
    if (frequency_hz == settings_.frequency_hz && !sweep_.any()) return;
    settings_.frequency_hz = frequency_hz;
    sweep_ = {};
    set_windows();
    begin();
}

void AmplitudeWitness::follow(const Sweep& sweep) noexcept {
    if (!sweep_.any()) {
        settings_.frequency_hz = sweep.from_hz;
        set_windows();
        window_ = std::min(
            window_,
            drivers::from_seconds(std::max(
                kWindow_s, kFewestSamples * drivers::to_seconds(settings_.sample_period))));
        block_ = window_ / static_cast<Time>(LockIn<1>::kBlocks);
        fewest_ = std::max(
            6.0, 0.5 * static_cast<double>(window_) / static_cast<double>(settings_.sample_period));
        begin();
    } else {
        // Another phase: what is in the windows is of the one before.
        force_.clear();
        table_.clear();
    }
    sweep_ = sweep;
}

bool AmplitudeWitness::blind() const noexcept {
    if (!sweep_.any()) return false;
    const double half_rate = 0.5 / drivers::to_seconds(settings_.sample_period);
    const double least = kFewestTurns / drivers::to_seconds(window_);
    const auto off = [&](Time at) { return std::abs(std::remainder(sweep_.hz(at), half_rate)); };
    return off(newest_) < least || off(newest_ - window_) < least;
}

void AmplitudeWitness::begin() noexcept {
    force_.clear();
    table_.clear();
    origin_ = newest_ = steady_since_ = judged_at_ = 0;
    block_number_ = 0;
    known_ = {};
    off_since_ = over_since_ = limit_since_ = {};
}

bool AmplitudeWitness::add(const Sample& sample) noexcept {
    if (origin_ == 0 || sample.time < newest_) {  // a device that has started anew
        begin();
        origin_ = sample.time;
        known_.fill(origin_);
    }
    bound_ = {!std::any_of(sample.quality.begin() + 3, sample.quality.begin() + 6,
                           [](Quality each) { return each == Quality::unbound; }),
              sample.of(Channel::table_accel) != Quality::unbound};
    newest_ = sample.time;
    const std::int64_t number = (sample.time - origin_) / block_;
    const bool complete = number != block_number_;
    if (complete) {
        if (number - block_number_ > static_cast<std::int64_t>(LockIn<1>::kBlocks)) {
            force_.clear();
            table_.clear();
            known_.fill(sample.time);  // of silence its age tells
        }
        for (; block_number_ < number &&
               number - block_number_ <= static_cast<std::int64_t>(LockIn<1>::kBlocks);
             ++block_number_) {
            force_.next_block();
            table_.next_block();
        }
        block_number_ = number;
    }
    const double turns = sweep_.any()
                             ? sweep_.turns(sample.time)
                             : settings_.frequency_hz * drivers::to_seconds(sample.time - origin_);
    const double angle = 2 * std::numbers::pi * (turns - std::floor(turns));
    const double c = std::cos(angle), s = std::sin(angle);
    if (sample.force_good()) force_.add(c, s, sample.force);
    if (sample.of(Channel::table_accel) == Quality::good) table_.add(c, s, {sample.table_accel});
    return complete;
}

double AmplitudeWitness::platform_g() const noexcept {
    LockIn<3>::Fit fit;
    if (blind() || !force_.fit(fit, fewest_)) return -1;
    Vector mean = fit.mean;
    for (std::size_t i = 0; i < 3; ++i) mean[i] -= settings_.zero_g[i];
    mean = times(settings_.matrix, mean);
    const Vector c = times(settings_.matrix, fit.cosine), s = times(settings_.matrix, fit.sine);
    const double gravity = std::sqrt(dot(mean, mean));
    // Along the vertical, which the mean force tells without any angle.
    if (gravity > kLeastGravity_g) return std::hypot(dot(mean, c), dot(mean, s)) / gravity;
    return std::sqrt(dot(c, c) + dot(s, s));
}

double AmplitudeWitness::table_g() const noexcept {
    LockIn<1>::Fit fit;
    if (blind() || !table_.fit(fit, fewest_)) return -1;
    return std::hypot(fit.cosine[0], fit.sine[0]);
}

AmplitudeWitness::Bounds AmplitudeWitness::bounds(const Situation& now, bool known, double low,
                                                  double high) const {
    if (now.steady && known && newest_ - steady_since_ >= kCommandWindow)
        return {std::min(low / kDecibel, low - kToleranceG),
                std::max(high * kDecibel, high + kToleranceG)};
    const bool upwards = now.ramp.target_g >= now.ramp.start_g;
    return {upwards && low >= kFromG ? low / 2 : 0, std::max(2 * high, kFromG)};
}

AmplitudeWitness::Verdict AmplitudeWitness::verdict(const Situation& now) noexcept {
    if (!now.steady) steady_since_ = 0;
    if (now.steady && steady_since_ == 0) steady_since_ = newest_;
    const Time from = newest_ - std::max(kCommandWindow, window_);
    // The controller began somewhere between the asking and the last write being read back.
    const Time late = now.controller_began == 0 ? drivers::kNever : now.controller_began;
    const std::array<double, 4> commands{now.ramp.at(from, now.ramp.begin),
                                         now.ramp.at(now.now, now.ramp.begin),
                                         now.ramp.at(from, late), now.ramp.at(now.now, late)};
    const double low = *std::ranges::min_element(commands);
    const double high = *std::ranges::max_element(commands);

    Verdict verdict;
    const auto suspect = look_for_stuck(now, low, verdict);
    const double platform = platform_g();
    verdict.seen_g = {platform < 0 ? -1 : platform / now.transmission, table_g()};
    const Time since_before = judged_at_ == 0 ? 0 : newest_ - judged_at_;
    std::array<bool, 2> shown_of{};
    for (std::size_t w = 0; w < 2; ++w) {
        const bool is_table = w == 1;
        const double seen = verdict.seen_g[w];
        const bool shown = shown_of[w] = seen >= 0 || std::isnan(seen);
        const bool known = is_table || now.ramp.transmission_known;
        const double doubt = known ? kDecibel : 2;
        const auto [least, most] = bounds(now, known, low, high);
        verdict.contradicts[w] = suspect[w];
        const auto judge = [&](Verdict::Finding& finding, bool wrong, Time& since) {
            // What is not known for a while is neither right nor wrong: that time does not count.
            if (!shown && !blind()) {
                if (since != 0) since += since_before;
                return;
            }
            wrong = wrong && shown;  // a NaN is wrong
            verdict.contradicts[w] = verdict.contradicts[w] || wrong;
            if (!lasting(wrong, since, newest_) || finding.wrong) return;
            finding = {true, is_table ? Channel::table_accel : Channel::accel_x, seen};
        };
        const double armed = now.ramp.armed_g;
        judge(verdict.off_command, !suspect[w] && !(seen >= least && seen <= most), off_since_[w]);
        judge(verdict.over_armed,
              armed > 0 && !(seen <= std::max(armed * doubt, armed + kToleranceG)), over_since_[w]);
        judge(verdict.over_limit, !(seen <= now.limit_g * (known ? 1 : doubt)), limit_since_[w]);
    }
    judged_at_ = newest_;
    look_for_unknown(now, shown_of, verdict);
    return verdict;
}

AmplitudeWitness::Verdict AmplitudeWitness::verdict_at_random(const Situation& now) noexcept {
    Verdict verdict;
    verdict.contradicts = look_for_stuck(now, now.steady ? now.ramp.target_g : 0, verdict);
    const auto enough = [this](std::size_t channel) {
        return std::isfinite(range(channel, LockIn<1>::kBlocks));
    };
    look_for_unknown(now, {enough(0), enough(3)}, verdict);
    return verdict;
}

/// Readings that are flagged, or beyond what they can show, are what an overload looks like.
void AmplitudeWitness::look_for_unknown(const Situation& now, const std::array<bool, 2>& shown,
                                        Verdict& verdict) noexcept {
    const Time patience =
        window_ + std::max(kWrongFor, kLeastSamplesUnknown * settings_.sample_period);
    const double half_rate = 0.5 / drivers::to_seconds(settings_.sample_period);
    const bool nobody_could =
        now.ramp.random == 0 &&
        (blind() || (!sweep_.any() &&
                     std::abs(std::remainder(settings_.frequency_hz, half_rate)) < kFromAlias_hz));
    for (std::size_t w = 0; w < 2; ++w) {
        if (shown[w] || !bound_[w] || nobody_could) known_[w] = newest_;
        if (newest_ - std::max(known_[w], now.ramp.begin + window_) <= patience) continue;
        verdict.contradicts[w] = true;
        if (!verdict.off_command.wrong)
            verdict.off_command = {true, w == 1 ? Channel::table_accel : Channel::accel_x, -1};
    }
}

double AmplitudeWitness::range(std::size_t channel, std::size_t blocks) const noexcept {
    const double fewest = std::max(
        3.0, fewest_ * static_cast<double>(blocks) / static_cast<double>(LockIn<1>::kBlocks));
    return channel < 3 ? force_.range(channel, blocks, fewest) : table_.range(0, blocks, fewest);
}

std::array<bool, 2> AmplitudeWitness::look_for_stuck(const Situation& now, double command_g,
                                                     Verdict& verdict) const noexcept {
    std::array<bool, 4> suspect{};
    std::array<double, 4> expected{};
    bool another_moves = false;
    for (std::size_t i = 0; i < 4; ++i) {
        const double count = settings_.count_g[i];
        // An axis that may be level after all should be still.
        const double share =
            i < 3 ? now.transmission * std::max(0.0, std::abs(now.ramp.raw_up[i]) - kLevelShare)
                  : 1;
        expected[i] = share * command_g;
        if (count == 0 || !(expected[i] > kStuckCounts * count)) continue;
        const double moved = range(i, kSuspectBlocks);
        suspect[i] = moved <= kMovesCounts * count;
        another_moves = another_moves || (std::isfinite(moved) && moved >= 0.5 * expected[i]);
    }
    // Where nothing moves at all the table may be dead, which the amplitude tells.
    if (!another_moves) return {};
    for (std::size_t i = 0; i < 4; ++i) {
        if (!suspect[i] || range(i, kStuckBlocks) > kMovesCounts * settings_.count_g[i]) continue;
        verdict.stuck = {true, static_cast<Channel>(static_cast<std::size_t>(Channel::accel_x) + i),
                         expected[i]};
    }
    return {suspect[0] || suspect[1] || suspect[2], suspect[3]};
}

}  // namespace vibrig::rt
