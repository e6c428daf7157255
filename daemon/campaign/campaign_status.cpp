// What the campaign says of itself.
#include <algorithm>
#include <cmath>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/stages/dwelling.hpp"
#include "daemon/campaign/stages/levelling.hpp"
#include "daemon/campaign/stages/stop_proof.hpp"
#include "daemon/campaign/stages/zeroing.hpp"
#include "estimator/identification/result.hpp"

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
            ? std::max(settings_.arming_valid_s -
                           drivers::to_seconds(ports_.log.steady_now() - armed_steady_),
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
    status.proof.asks = proving_->asks_for();
    fill_rest(status, now);
    // Of what has ended nothing is left and nothing is commanded.
    const bool recording = state_ == State::recording;
    status.remaining_s = 0;
    status.command_table_g = stage_ != nullptr ? stage_->table_g() : 0;
    const double done =
        static_cast<double>(positions_done_) + (recording ? dwelling_->part_done(now) : 0);
    status.progress = begun ? done / total : 0;
    if (active()) {
        status.remaining_s =
            pace_.left_s(expected_ - std::min(positions_done_, expected_), expected_stop_s(),
                         recording ? dwelling_->left_s(now) : settings_.dwell_s, now) +
            times_.closing_s;
    }
    if (active() || state_ == State::checking)
        status.command_frequency_hz = excitation_.frequency_hz();
}

double Campaign::expected_stop_s() const {
    if (stops_.empty()) return nominal_stop_s();
    double slew_s = 0;  // and what sweeps take longer
    for (const auto& [stop, run, position] : stops_) {
        if (stop.sweep.any()) slew_s += settings_.dwell_s_of(stop) - settings_.dwell_s;
    }
    for (std::size_t i = 1; i < stops_.size(); ++i) {
        double farthest_deg = 0;
        for (std::size_t axis = 0; axis < 3; ++axis)
            farthest_deg = std::max(
                farthest_deg, std::abs(std::remainder(stops_[i].stop.position_deg[axis] -
                                                          stops_[i - 1].stop.position_deg[axis],
                                                      360.0)));
        slew_s += farthest_deg / settings_.zero.slew_deg_per_s;
    }
    return nominal_stop_s() + slew_s / static_cast<double>(stops_.size());
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
    if (level_) level_->leveller().fill(status.levelling);
    if (zero_) zeros()->fill(status.zeros);
    status.loop_check = loop_->status();
    status.rest_check = rest_check_;
    if (!mark_.empty()) status.zeros.mark = mark_;
}

}  // namespace vibrig::campaign
