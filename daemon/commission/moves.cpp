// What a step is made of but for questions: moving to a place, standing there, averaging.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/commission/procedure.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::commission {

using drivers::kSecond;
using drivers::Time;

namespace {

constexpr Time kStale = kSecond / 2;
constexpr Time kStill = 20 * kSecond;  // what does not stand within it does not stand
constexpr double kOneWay_deg = 165;    // a longer move goes by the start: there is one shorter way
// Of the force's direction: a platform rocks when a slew ends.
constexpr double kRocks_deg = 2;
constexpr double kSlewShare = 0.02;  // ratios agree to it

/// Of a force of 1 g, at least: where an accelerometer is dead the rest turns less.
double turned_deg(const Vec3& a, const Vec3& b) {
    const double chord = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    return 2 * estimator::kDegPerRad * std::asin(std::min(1.0, chord / 2));
}

/// First differences: what is wanted is the noise, not the drift of a free platform.
Vec3 noise_of(const std::vector<Look>& samples) {
    Vec3 noise{};
    for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (std::size_t i = 1; i < samples.size(); ++i)
            sum +=
                std::pow(std::remainder(samples[i].angle[c] - samples[i - 1].angle[c], 360.0), 2);
        noise[c] = std::sqrt(sum / 2 / std::max<double>(1, double(samples.size()) - 1));
        noise[c] = std::max(noise[c], 1e-9);
    }
    return noise;
}

}  // namespace

Vec3 Procedure::within_travel(Vec3 travel) const {
    for (std::size_t k = 0; k < 3; ++k)
        travel[k] = std::clamp(travel[k], limits_deg_[k][0], limits_deg_[k][1]);
    return travel;
}

/// Of a channel, in its unit. A ratio that was measured would be wrong by its noise at each turn's
/// end: 1e-4 of a turn are two arc minutes, as much as a torque turns in seconds. So it is that of
/// the unit, where it is one that is known.
double Procedure::whole_turn(std::size_t c) const {
    constexpr double kIsUnit = 0.02;  // they are 10 % apart at least
    const double ratio = std::abs(ratio_[c]);
    if (ratio == 0) return 360;
    for (const auto& unit : estimator::commissioning::angle_units())
        if (std::abs(ratio * unit.degrees - 1) < kIsUnit) return 360 / unit.degrees;
    return 360 * ratio;
}

Vec3 Procedure::unwrapped(const Vec3& angle, const Vec3& near) const {
    Vec3 out = angle;
    for (std::size_t c = 0; c < 3; ++c)
        out[c] = near[c] + std::remainder(angle[c] - near[c], whole_turn(c));
    return out;
}

void Procedure::move(const Vec3& travel, Then then) {
    asked_ = within_travel(travel);
    then_ = std::move(then);
    if (by_hand_) {
        std::string what;
        for (std::size_t k = 0; k < 3; ++k) {
            if (asked_[k] == travel_[k]) continue;
            what += fmt::format("{}{} to {:+.0f} deg", what.empty() ? "" : ", ", kLoudNames[k],
                                asked_[k]);
        }
        travel_ = asked_;
        const auto still = [this](const std::string&) {
            since_ = now_;
            doing_ = Doing::settling;
        };
        if (what.empty()) return still("");
        return ask({"hand", "By hand, from the start, within 20 deg: " + what + "; hold still.",
                    "done", "done", done_alone},
                   still);
    }
    legs_.clear();
    if (released_ && !replaying_) travel_ = read_travel(travel_);
    Vec3 between = asked_;
    for (std::size_t k = 0; k < 3; ++k)
        if (std::abs(asked_[k] - travel_[k]) >= kOneWay_deg) between[k] = 0;
    if (between != asked_) legs_.push_back(between);
    legs_.push_back(asked_);
    next_leg();
}

void Procedure::next_leg() {
    const Vec3 to = legs_.front();
    before_ = rig_->sample();
    moving_slot_ = 3;
    int moved = 0;
    Vec3 command{};
    for (std::size_t k = 0; k < 3; ++k) {
        command[k] = command_0_[k] + to[k];
        if (to[k] == travel_[k]) continue;
        moving_slot_ = k;
        ++moved;
    }
    if (moved != 1) moving_slot_ = 3;
    since_ = now_;
    doing_ = Doing::moving;
    command_to(command);
}

void Procedure::command_to(const Vec3& command) {
    commanded_ = true;
    released_ = false;
    note("move", {{"command_deg", command}});
    if (replaying_) return;
    if (counting_)
        rig_->slew_counting(command, now_);
    else
        rig_->slew(command, now_);
}

void Procedure::release() {
    released_ = true;
    if (!replaying_) rig_->release(now_);
}

void Procedure::average(double seconds, Then then) {
    wanted_s_ = seconds;
    seconds_.clear();
    then_ = std::move(then);
    since_ = now_;
    doing_ = Doing::averaging;
}

/// Why what is seen is not what was asked; empty: it may be.
std::string Procedure::contradiction(const Look& seen) const {
    double asked = 0;
    for (std::size_t k = 0; k < 3; ++k)
        asked = std::max(asked, std::abs(legs_.front()[k] - travel_[k]));
    // Nothing that is not known yet goes far; a way back, which is longer, is known.
    constexpr double kCareful_deg = 5;
    const bool careful = careful_ && asked < kCareful_deg;
    const double most = careful ? std::min(3 * asked, kCareful_deg) : 3 * asked;
    if (const double turned = turned_deg(seen.force, before_.force); turned > most + kRocks_deg)
        return fmt::format("gravity turned by {:.1f} deg, {:.2f} commanded", turned, asked);
    const Vec3 angle = unwrapped(seen.angle, before_.angle);
    for (std::size_t c = 0; c < 3; ++c) {
        const double change = std::abs(angle[c] - before_.angle[c]);
        if (!holds_ && change > kHolds_deg + 20 * noise_[c])
            return fmt::format("{} moved by {:.2f} when commanded where it is", names_.angle[c],
                               change);
        const bool own = moving_slot_ < 3 && channel_of_[moving_slot_] == c;
        if (ratio_[c] != 0 && change > std::abs(ratio_[c]) * (most + 0.5) + 10 * noise_[c])
            return fmt::format("{} moved by {:.4g}, {:.4g} expected", names_.angle[c], change,
                               std::abs(ratio_[c]) * asked);
        if (careful_ && moving_slot_ < 3 && channel_of_[moving_slot_] < 3 && !own &&
            change > 10 * noise_[c] + 1e-12)
            return fmt::format("{} moves with the {} gimbal", names_.angle[c],
                               kLoudNames[moving_slot_]);
    }
    return {};
}

void Procedure::watch_move(Time now) {
    const Look seen = rig_->sample();
    if (!seen.good || now - seen.to > kStale) return stop("a channel is silent or not good", now);
    if (const auto wrong = contradiction(seen); !wrong.empty())
        return conclude(
            Verdict::undecided,
            fmt::format("stopped: {}: look at the rig, then by hand (--by-hand)", wrong),
            keys_of_moving());
    switch (rig_->gimbal()) {
        case drivers::GimbalState::in_position:
            return arrive(now);
        case drivers::GimbalState::timed_out:
            return conclude(
                Verdict::undecided,
                fmt::format(
                    "the command of the {} is not obeyed: not in position within its time{}",
                    moving_slot_ < 3 ? std::string(kLoudNames[moving_slot_]) + " gimbal"
                                     : std::string("gimbals"),
                    stopped_short().empty() ? "" : "; " + stopped_short()),
                keys_of_moving());
        case drivers::GimbalState::no_status:
            return stop("no gimbal status", now);
        default:
            return;
    }
}

/// Why a gimbal that says it is in position is not; empty: it is, or nobody knows yet.
std::string Procedure::stopped_short() const {
    const Vec3 asked = legs_.front(), read = read_travel(asked);
    for (std::size_t k = 0; k < 3; ++k) {
        if (channel_of_[k] == 3 || ratio_[channel_of_[k]] == 0) continue;
        if (std::abs(read[k] - asked[k]) <= kHolds_deg + kSlewShare * std::abs(asked[k])) continue;
        return fmt::format(
            "the {} gimbal stands at a travel of {:+.1f} deg, {:+.1f} commanded: a "
            "soft stop?",
            kLoudNames[k], read[k], asked[k]);
    }
    return {};
}

/// What is in position short of where it was sent has a stop there, and is sent no further.
void Procedure::keep_within(const std::string& why) {
    const Vec3 asked = legs_.front();
    travel_ = read_travel(asked);
    for (std::size_t k = 0; k < 3; ++k) {
        auto& [least, most] = limits_deg_[k];
        if (asked[k] > 0 && travel_[k] < asked[k] - kHolds_deg) most = std::max(travel_[k], 0.0);
        if (asked[k] < 0 && travel_[k] > asked[k] + kHolds_deg) least = std::min(travel_[k], 0.0);
    }
    met_a_stop_ = true;
    for (Vec3& leg : legs_) leg = within_travel(leg);
    tell("   " + why);
    note("reading", {{"soft_stop", why}, {"travel_deg", limits_deg_}});
    keep({{"short", travel_}, {"limits", limits_deg_}});
}

void Procedure::arrive(Time now) {
    travel_ = legs_.front();
    if (const auto why = stopped_short(); !why.empty()) keep_within(why);
    legs_.erase(legs_.begin());
    if (!legs_.empty()) return next_leg();
    since_ = now;
    doing_ = Doing::settling;
}

void Procedure::take_second(Time now) {
    const Look second = rig_->second();
    const bool fresh = seconds_.empty() || second.from > seconds_.back().from;
    if (second.good && second.from >= since_ && fresh) {
        seconds_.push_back(second);
        if (seconds_.size() > 1) {
            Look& last = seconds_.back();
            last.angle = unwrapped(last.angle, seconds_.front().angle);
        }
    }
    if (static_cast<double>(seconds_.size()) + 1e-9 < wanted_s_) {
        if (now - since_ > drivers::from_seconds(wanted_s_) + kStill)
            conclude(Verdict::refused,
                     "the platform does not stand still, or force or angles are not good");
        return;
    }
    mean_ = seconds_.front();
    for (std::size_t i = 0; i < 3; ++i) {
        mean_.angle[i] = mean_.force[i] = 0;
        for (const Look& one : seconds_) {
            mean_.angle[i] += one.angle[i] / static_cast<double>(seconds_.size());
            mean_.force[i] += one.force[i] / static_cast<double>(seconds_.size());
        }
    }
    if (noise_ == Vec3{}) noise_ = noise_of(samples_);
    note("reading", {{"angle", mean_.angle}, {"force_g", mean_.force}, {"seconds", wanted_s_}});
    keep_mean();
    auto then = std::move(then_);
    then();
}

Vec3 Procedure::read_travel(const Vec3& near) const {
    const Look seen = rig_->sample();
    const Vec3 angle = unwrapped(seen.angle, start_);
    Vec3 travel = near;
    for (std::size_t k = 0; seen.good && k < 3; ++k) {
        const std::size_t c = channel_of_[k];
        if (c == 3 || ratio_[c] == 0) continue;
        // Of the whole turns between the nearest to where it came from.
        travel[k] = near[k] + std::remainder((angle[c] - start_[c]) / ratio_[c] - near[k], 360.0);
    }
    return travel;
}

/// Of a command, and the channel that follows it.
std::vector<std::string> Procedure::keys_of_moving() const {
    std::vector<std::string> keys{"gimbal.message"};
    if (moving_slot_ < 3 && channel_of_[moving_slot_] < 3)
        keys.push_back(key_of(channel_of_[moving_slot_]));
    return keys;
}

}  // namespace vibrig::commission
