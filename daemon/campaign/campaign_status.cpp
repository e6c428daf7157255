// What the campaign says of itself.
#include <algorithm>
#include <cmath>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/levelling_stage.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/zeroing_stage.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;

void Campaign::fill(StatusData& status, Time now) const {
    status.campaign_name = settings_.name;
    status.state = state_;
    status.reason = reason_;
    status.armed_by = armed_by_;
    status.started_by = started_by_;
    status.armed_for = armed_by_.empty() ? std::string() : armed_for_;
    status.arming_left_s =
        state_ == State::armed
            ? std::max(settings_.arming_valid_s - drivers::to_seconds(ports_.wall() - armed_wall_),
                       1e-3)
            : 0;
    status.resume_offer = resume_offer();
    status.runs = static_cast<int>(runs());
    status.positions = static_cast<int>(positions());
    status.dwells = dwells_;
    const auto total = static_cast<double>(std::max<std::size_t>(expected_, 1));
    const bool begun = active() || state_ == State::finished || !dwells_.empty();
    if (begun && at_ < stops_.size()) {
        status.run = here().run;
        status.position = here().position;
        status.position_deg = here().stop.position_deg;
    }
    fill_stages(status);
    proof_.fill(status.proof, utc_ns());
    const bool press = state_ == State::checking && check_ == Check::press && requested_;
    const bool close = pressed_ == Pressed::open && ports_.shaker.reading().emergency_stop_open;
    status.proof.asks = press   ? "press the emergency stop now"
                        : close ? "close the emergency-stop chain again"
                                : "";
    fill_rest(status, now);
    // Of what has ended nothing is left and nothing is commanded.
    status.remaining_s = 0;
    status.command_table_g = 0;
    double done = static_cast<double>(positions_done_);
    if (state_ == State::recording && dwell_to_ > dwell_from_) {
        done += std::clamp(
            static_cast<double>(now - dwell_from_) / static_cast<double>(dwell_to_ - dwell_from_),
            0.0, 1.0);
    }
    status.progress = begun ? done / total : 0;
    if (active()) {
        // What is left at the pace so far, at first at the nominal one.
        const auto before = static_cast<double>(positions_before_);
        const double pace = positions_done_ > positions_before_
                                ? drivers::to_seconds(now - started_) / (done - before)
                                : nominal_stop_s();
        status.remaining_s = (total - done) * pace + times_.closing_s;
        const bool vibrating =
            state_ == State::ramping || state_ == State::settling || state_ == State::recording;
        status.command_table_g = vibrating ? table_g() : 0;
        status.command_frequency_hz = settings_.frequency_hz;
    } else if (state_ == State::checking) {
        status.command_table_g =
            check_ == Check::look || check_ == Check::rest ? 0 : settings_.loop.table_g;
        status.command_frequency_hz = settings_.frequency_hz;
    }
}

void Campaign::fill_rest(StatusData& status, Time now) const {
    RestStatus& rest = status.rest;
    rest.witnesses = stop_.rest(now);
    rest.disobeyed = stop_.disobeyed();
    rest.what = stop_.stopping() ? stop_.what_moves(now) : std::string();
    rest.state = rest.disobeyed              ? "stop not obeyed"
                 : stop_.stopping()          ? "stopping"
                 : rest.witnesses.moving()   ? "moving"
                 : rest.witnesses.measured() ? "at rest"
                                             : "unknown";
}

void Campaign::qualify(estimator::Result& result) const {
    estimator::widen_amplitudes(result, level_variances_);
}

void Campaign::fill_stages(StatusData& status) const {
    status.levelling = {};
    status.zeros = {};
    if (level_) level_->fill(status.levelling);
    if (zero_) zero_->fill(status.zeros);
    status.loop_check = loop_->status();
    if (!mark_.empty()) status.zeros.mark = mark_;
}

}  // namespace vibrig::campaign
