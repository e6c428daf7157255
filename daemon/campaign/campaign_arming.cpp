// Who may arm and acknowledge, for what, and for how long.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/stages/opening.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;

namespace {

/// "2 h 5 min", "47 min", "12 s".
std::string duration_text(double seconds) {
    if (seconds < 90) return fmt::format("{:.0f} s", seconds);
    const auto minutes = static_cast<long>(std::lround(seconds / 60));
    if (minutes < 60) return fmt::format("{} min", minutes);
    return fmt::format("{} h {} min", minutes / 60, minutes % 60);
}

/// Which profiles the plan plays, and how loud they are at most.
template <typename Stops>
std::string profiles_text(const Stops& stops) {
    std::string profiles;
    std::vector<std::uint16_t> listed;
    for (const auto& [stop, run, position] : stops) {
        if (!stop.random ||
            std::ranges::find(listed, stop.random->set_point.profile) != listed.end())
            continue;
        const auto& point = stop.random->set_point;
        listed.push_back(point.profile);
        double highest_g = 0;
        for (const auto& other : stops) {
            if (other.stop.kind() == stop.kind())
                highest_g = std::max(highest_g, other.stop.table_g);
        }
        profiles += fmt::format(
            ", random by profile '{}' (number {}, checksum {:08x}, up to {:.3g} g "
            "rms, 3 sigma {:.3g} g)",
            stop.random->name, point.profile, point.checksum, highest_g, 3 * highest_g);
    }
    return profiles;
}

/// " at 15, 85.1 Hz"; of a campaign that shakes with no sine nothing.
template <typename Stops>
std::string frequencies_text(const Stops& stops, double reference_hz) {
    std::set<double> listed;
    for (const auto& [stop, run, position] : stops) {
        if (stop.random || stop.sweep.any() || stop.table_g <= 0) continue;
        listed.insert(stop.frequency_hz > 0 ? stop.frequency_hz : reference_hz);
    }
    std::string text;
    for (const double hz : listed) text += fmt::format("{}{:g}", text.empty() ? " at " : ", ", hz);
    return text.empty() ? text : text + " Hz";
}

/// Likewise the sweeps.
template <typename Stops>
std::string sweeps_text(const Stops& stops) {
    std::string text;
    for (const auto& [stop, run, position] : stops) {
        if (!stop.sweep.any()) continue;
        const auto one = fmt::format(", sweep from {:g} to {:g} Hz in {:g} s", stop.sweep.from_hz,
                                     stop.sweep.to_hz, stop.sweep.seconds);
        if (text.find(one) == std::string::npos) text += one;
    }
    return text;
}

}  // namespace

void Campaign::take_over_trip(const std::string& causes, bool unseen) {
    state_ = State::tripped;
    reason_ = causes;
    if (ports_.rig.torquer != nullptr) ports_.rig.torquer->doubt();
    // Silence is no rest then.
    if (unseen) stop_.excited(std::max(highest_level(), settings_.loop.table_g));
}

void Campaign::take_over_torque() {
    if (ports_.rig.torquer == nullptr) return;
    ports_.rig.torquer->doubt();
    torque_left_ = true;
}

bool Campaign::torque_ended(Time now) const {
    if (!torque_left_ || !ports_.rig.torquer->zero() || torquing(ports_.rig)) return false;
    const auto* const feed = ports_.rig.feed;
    const Time said = feed != nullptr && feed->knows_torque() ? feed->torque().time : now;
    return said - torque_sent_ > drivers::kSecond;
}

std::string Campaign::not_fit_to_arm(Time now) const {
    if (active() && !paused_disarmed()) return "a campaign is running";
    if (state_ == State::checking) return check_under_way();
    if (state_ == State::commissioning) return "the rig is being commissioned by " + reason_;
    if (state_ == State::tripped) return "tripped (" + reason_ + "): acknowledge it first";
    if (auto why = loop_->refusal(); !why.empty()) return why;
    if (auto why = proof_.refusal(utc_ns()); !why.empty()) return why;
    return not_fit_to_excite(now);
}

std::string Campaign::begin_commissioning(const std::string& by, Time now) {
    if (shutting_down_) return "the daemon is shutting down";
    if (active()) return "a campaign is running";
    if (state_ == State::checking) return check_under_way();
    if (state_ == State::armed) return "armed for a campaign: abort that first";
    if (state_ == State::tripped) return "tripped (" + reason_ + "): acknowledge it first";
    if (auto why = platform_lacks(ports_.rig.platform(), now); !why.empty()) return why;
    if (auto why = may_slew(ports_.rig, stop_); !why.empty()) return why;
    ports_.rig.gimbal.forget_position();
    reason_ = by;
    torque_left_ = false;
    enter(State::commissioning, now);
    return {};
}

void Campaign::end_commissioning(Time now) {
    if (state_ != State::commissioning) return;
    reason_.clear();
    enter(State::idle, now);
}

std::string Campaign::not_fit_to_acknowledge(Time now) const {
    if (stop_.disobeyed() && stop_.stopping())
        return "a stop was not obeyed, not at rest yet: " + stop_.what_moves(now) +
               ": press the emergency stop";
    const auto shaker = ports_.rig.shaker.reading();
    const bool changed = shaker.watchdog == drivers::WatchdogTimeout::changed;
    const bool latched = shaker.valid && (shaker.fault != 0 || changed) && !active();
    if (latched && shaker.emergency_stop_open)
        return "the emergency-stop chain is open: close it first";
    if (latched && !shaker.still()) return "the table is not at rest yet";
    if (stop_.stopping() && stop_.unsettled(now)) {
        const auto why = stop_.what_moves(now);
        return "a stop is under way, rest is not measured yet" + (why.empty() ? why : ": " + why);
    }
    return latched || state_ == State::tripped ? "" : "nothing to acknowledge";
}

std::string Campaign::refusal(const CommandRequest& request, Time now) const {
    using Kind = CommandRequest::Kind;
    if (request.by.empty()) return "by: found nothing, expected the name of a person";
    if (shutting_down_) return "the daemon is shutting down";
    if (request.kind == Kind::arm) return not_fit_to_arm(now);
    if (request.kind == Kind::selftest)
        return request.argument == kRestCheck ? not_fit_to_open(now) : not_fit_to_check(now);
    if (request.kind == Kind::acknowledge) return not_fit_to_acknowledge(now);
    return {};
}

std::string Campaign::arming_text(const CommandRequest& request) const {
    const std::string unit = settings_.unit.empty() ? "a unit that is not stated" : settings_.unit;
    if (request.kind == CommandRequest::Kind::selftest && request.argument.starts_with("at_zero"))
        return unit + ", a run at 0 g";
    if (request.kind == CommandRequest::Kind::selftest)
        return fmt::format("{}, loop check, {:g} g at the table", unit, settings_.loop.table_g);
    const std::string plan =
        settings_.adaptive ? std::string("positions chosen one by one")
                           : fmt::format("{} positions{}", stops_.size(),
                                         settings_.plan.empty() ? "" : " of " + settings_.plan);
    const auto after = [this](std::size_t done) {
        const double stops_s = static_cast<double>(stops_.size() - done) * expected_stop_s();
        return "about " + duration_text(stops_s + times_.opening_s + times_.closing_s);
    };
    // What was interrupted is offered: `resume` goes on with it, `start` begins anew.
    const std::string resumed =
        active() || offer_.empty() ? "" : ", resumed " + after(offer_.size());
    const std::string lasts = settings_.adaptive
                                  ? settings_.time_limit_s > 0
                                        ? "at most " + duration_text(settings_.time_limit_s)
                                        : std::string("until its targets are met")
                                  : after(active() ? at_ : 0) + resumed;
    return fmt::format(
        "{}, plan \"{}\" ({}), up to {:g} g at the table{}{}, platform {}, {}; "
        "to be {} within {}",
        unit, settings_.name, plan, highest_level(),
        frequencies_text(stops_, settings_.frequency_hz),
        profiles_text(stops_) + sweeps_text(stops_),
        settings_.hard_mount ? "bolted hard to it" : "on isolators", lasts,
        active() ? "resumed" : "started", duration_text(settings_.arming_valid_s));
}

/// Nobody started it, or went on with it: whoever armed may long have gone home.
void Campaign::watch_arming(Time now) {
    const bool pausing = state_ == State::paused && pause_asked_ && !armed_by_.empty();
    if (state_ != State::armed && !pausing) return;
    const Time since = pausing ? std::max(armed_steady_, paused_steady_) : armed_steady_;
    if (ports_.log.steady_now() - since < drivers::from_seconds(settings_.arming_valid_s)) return;
    ports_.log.event(
        Severity::warning,
        fmt::format("the arming by {} has expired: not {} within {}", std::exchange(armed_by_, {}),
                    pausing ? "resumed" : "started", duration_text(settings_.arming_valid_s)));
    if (!pausing) enter(State::idle, now);
}

bool Campaign::paused_disarmed() const { return state_ == State::paused && armed_by_.empty(); }

void Campaign::arm(const CommandRequest& request, Time now) {
    armed_for_ = arming_text(request);
    armed_by_ = request.by;
    armed_steady_ = ports_.log.steady_now();
    excitation_.armed();
    if (state_ == State::paused) return;  // it keeps its place, and its reason
    reason_.clear();
    enter(State::armed, now);
}

/// As much as a start, and whoever armed is still there.
std::string Campaign::not_fit_to_resume(Time now) const {
    if (armed_by_.empty())
        return fmt::format(
            "paused for more than {}, which has ended the arming: a named person "
            "arms it first",
            duration_text(settings_.arming_valid_s));
    if (auto why = proof_.refusal(utc_ns()); !why.empty()) return why;
    return not_fit_to_excite(now);
}

CommandReply Campaign::resume(const CommandRequest& request, Time now) {
    if (state_ != State::paused && !pause_asked_) return {false, "not paused"};
    if (state_ == State::paused) {
        if (const auto why = not_fit_to_resume(now); !why.empty()) return {false, why};
        vibration_off_.clear();  // looked at anew
    }
    pause_asked_ = false;
    const double ago_s = drivers::to_seconds(ports_.log.steady_now() - armed_steady_);
    const auto armed = fmt::format("armed by {} {} ago", armed_by_, duration_text(ago_s));
    ports_.log.event(Severity::info, fmt::format("resumed by {}, {}", request.by, armed));
    return {true, "resumed, " + armed};
}

}  // namespace vibrig::campaign
