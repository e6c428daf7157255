// What the campaign asks of the shaker: levels, ramps down, stops, and whether they were obeyed.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/rig_frame.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::Time;
using State = CampaignState;

/// A stop of this thread's own does not end the arming.
void Campaign::stop_shaker() {
    ports_.rig.shaker.stop_now();
    ++armed_under_;
    asked_g_ = 0;
    tell_ramp(0, ports_.rig.shaker.reading().time);
}

double Campaign::highest_level() const {
    if (state_ == State::checking) return settings_.loop.table_g;
    if (settings_.stops.empty()) return *std::ranges::max_element(settings_.table_g);
    return std::ranges::max_element(levels_)->first;
}

bool Campaign::ask_level(double table_g, Time now) {
    stop_.excited(table_g);
    if (!ports_.rig.shaker.request({excited_hz_, table_g, settings_.ramp_s}, armed_under_))
        return false;
    tell_ramp(table_g, now);
    return true;
}

void Campaign::tell_ramp(double table_g, Time now) {
    const double start_g = std::exchange(asked_g_, table_g);
    asked_at_ = now;
    const RigFrame frame(settings_.rig);
    ports_.rig.ramping({start_g, table_g, now, from_seconds(settings_.ramp_s), highest_level(),
                        state_ != State::checking, frame.to_raw(frame.up_at_deg(excited_deg_)),
                        excited_hz_, excited_transmission_});
}

void Campaign::order_stop(const std::string& by) {
    stopped_by_ = by;
    ports_.rig.shaker.stop_now();
}

void Campaign::watch_stop(Time now) {
    // A hand, a slew or a torquer on the platform is no shaker.
    const bool handled = state_ == State::slewing || state_ == State::paused ||
                         state_ == State::zeroing || state_ == State::levelling || opening() ||
                         commissioning();
    switch (stop_.update(now, handled)) {
        case StopMonitor::News::none:
            return;
        case StopMonitor::News::uncommanded:
            ports_.log.event(Severity::trip, "motion without a command: " + stop_.what_moves(now));
            ports_.rig.uncommanded();
            return;
        case StopMonitor::News::confirmed:
            ports_.rig.disobeyed(false);
            return ports_.log.event(Severity::info,
                                    fmt::format("stop confirmed: rest measured {:.2f} s after the "
                                                "order ({})",
                                                stop_.took_s(), stopped_by_));
        case StopMonitor::News::disobeyed: {
            const auto what =
                fmt::format("stop not obeyed within {:.1f} s ({}): {}: press the emergency stop",
                            stop_.took_s(), stopped_by_, stop_.what_moves(now));
            ports_.log.event(Severity::trip, what);
            if (state_ == State::tripped) reason_ += "; " + what;
            ports_.rig.disobeyed(true);
        }
    }
}

/// Ramps down; true once rest is measured.
bool Campaign::come_to_rest(Time now) {
    const auto reading = ports_.rig.shaker.reading();
    if (!ports_.rig.shaker.busy() && !stop_.stopping() && reading.at_rest() &&
        reading.time > entered_ && stop_.rest(now).measured_since(entered_)) {
        stop_.at_rest();
        return true;
    }
    if (!requested_ && !stop_.stopping()) {
        requested_ = ask_level(0, now);
        if (!requested_) {  // no ramp to be had: the hard way
            stop_sent_ = true;
            tell_ramp(0, now);
            stopped_by_ = "no ramp down was to be had";
            stop_shaker();
        }
    }
    if (!stop_sent_ &&
        now - entered_ > from_seconds(settings_.ramp_s + settings_.stop.deadline_s)) {
        stop_sent_ = true;
        if (shutting_down_) {
            ports_.log.event(Severity::alarm, "shaker did not come to rest in time: stop ordered");
            order_stop("the ramp down took too long");
        } else {
            abort("the shaker did not come to rest in time", now);
        }
    }
    return false;
}

}  // namespace vibrig::campaign
