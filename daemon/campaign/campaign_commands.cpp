// What persons order, and whether the rig is fit for it.
#include <spdlog/fmt/fmt.h>

#include <utility>

#include "daemon/campaign/campaign.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;

CommandReply Campaign::command(const CommandRequest& request, Time now) {
    using Kind = CommandRequest::Kind;
    const auto refuse = [&](const std::string& why) { return CommandReply{false, why}; };
    const auto accept = [&](const std::string& text) {
        ports_.log.event(Severity::info, fmt::format("{} by {}", text, request.by));
        return CommandReply{true, text};
    };
    if (request.by.empty()) return refuse("by: found nothing, expected the name of a person");
    if (shutting_down_) return refuse("the daemon is shutting down");
    switch (request.kind) {
        case Kind::arm:
            if (const auto why = not_fit_to_arm(now); !why.empty()) return refuse(why);
            arm(request, now);
            return accept("armed for " + armed_for_);
        case Kind::start:
            if (active()) return refuse("a campaign is running, started by " + started_by_);
            if (state_ == State::checking) return refuse(check_under_way());
            if (state_ != State::armed) return refuse("not armed: a named person arms it first");
            if (const auto why = not_fit_to_excite(now); !why.empty()) return refuse(why);
            if (!ports_.dwells.free()) return refuse("the last dwell is still being closed");
            offer_.clear();
            offered_stops_.clear();
            offered_last_.reset();
            ports_.dwells.begin();
            begin(request.by, now);
            return accept(started_by_ == armed_by_ ? "campaign started"
                                                   : "campaign started, armed by " + armed_by_);
        case Kind::pause:
            if (!active()) return refuse("no campaign is running");
            pause_asked_ = true;
            return accept("pause before the next position");
        case Kind::resume:
            if (!active() && !offer_.empty()) return resume_interrupted(request, now);
            return resume(request, now);
        case Kind::abort:
            if (active() || state_ == State::armed || state_ == State::checking ||
                state_ == State::commissioning) {
                abort("aborted by " + request.by, now);
            } else {
                excitation_.order_stop("stopped by " + request.by);
            }
            return accept("stop sent");
        case Kind::acknowledge:
            return acknowledge(request, now);
        case Kind::selftest:
            return begin_check(request, now);
        case Kind::commission:  // the daemon's, by begin_commissioning()
        case Kind::certificate:
            break;
    }
    return refuse("unknown command");
}

CommandReply Campaign::acknowledge(const CommandRequest& request, Time now) {
    // One acknowledgement is for both: the controller latches its faults, too, and forgets
    // them when it is ordered to stop at rest.
    if (const auto why = not_fit_to_acknowledge(now); !why.empty()) return {false, why};
    const auto shaker = ports_.rig.shaker.reading();
    const bool changed = shaker.valid && shaker.watchdog == drivers::WatchdogTimeout::changed;
    const bool latched = shaker.valid && (shaker.fault != 0 || changed) && !active();
    std::string what;
    // The stop writes the timeout again, too.
    if (latched) {
        what = shaker.fault != 0
                   ? fmt::format("shaker fault {:#06x}", shaker.fault)
                   : fmt::format("watchdog timeout of {:g} s", shaker.watchdog_timeout_s);
    }
    if (state_ == State::tripped) {
        what = std::exchange(reason_, {}) + (latched ? "; " + what : "");
        enter(State::idle, now);
    }
    stop_.acknowledge();
    if (latched) excitation_.stop("acknowledged by " + request.by);
    what = "acknowledged: " + what;
    ports_.log.event(Severity::info, fmt::format("{} by {}", what, request.by));
    return {true, what};
}

std::string Campaign::not_fit_to_excite(Time now) const {
    if (auto why = ports_.rig.unfit(); !why.empty()) return why;
    if (writes_held_)
        return "nothing but a stop is written to the controller: its registers had not been tried "
               "when vibrigd started; start it again once they were";
    return not_at_rest(now);
}

/// What a controller that is only read has in its timeout says nothing of the daemon's writing.
std::string Campaign::not_at_rest(Time now) const {
    const auto reading = ports_.rig.shaker.reading();
    if (ports_.rig.shaker.stop_pending()) return "a stop of the shaker is pending";
    if (stop_.stopping()) {
        const auto why = stop_.what_moves(now);
        return "stopping: rest is not measured yet" + (why.empty() ? why : ": " + why);
    }
    if (!reading.valid) return "no valid read-back from the shaker";
    if (reading.emergency_stop_open) return "the emergency-stop chain is open";
    if (reading.fault != 0 || reading.state == drivers::kShakerFault)
        return fmt::format("shaker fault {:#06x}", reading.fault);
    if (!writes_held_ && reading.watchdog == drivers::WatchdogTimeout::changed)
        return fmt::format("the controller's watchdog timeout reads {:g} s, not what was written",
                           reading.watchdog_timeout_s);
    if (!writes_held_ && reading.watchdog == drivers::WatchdogTimeout::unread)
        return "the controller's watchdog timeout has not been read back yet";
    if (!reading.at_rest()) return "the shaker is not at rest";
    if (stop_.rest(now).moving()) return "not at rest: " + stop_.what_moves(now);
    return {};
}

}  // namespace vibrig::campaign
