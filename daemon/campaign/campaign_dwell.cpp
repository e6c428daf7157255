// One position of the campaign: slew, ramp, settle, record, rest.
#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/stages/dwelling.hpp"
#include "daemon/campaign/stages/levelling.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "daemon/campaign/stages/zeroing.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;
using Came = StageStep::Kind;

Time Campaign::slew(Time now) {
    // Gimbals never slew on a moving shaker, whoever moves it.
    if (!ports_.rig.shaker.reading().at_rest() || (!slew_ordered_ && stop_.rest(now).moving())) {
        if (slew_ordered_) {
            abort("the shaker left rest during a slew", now);
        } else {
            enter(State::resting, now);
        }
        return now;
    }
    if (!slew_ordered_) {
        if (const auto why = may_slew(ports_.rig, stop_); !why.empty()) {
            abort(why, now);
            return now;
        }
        ports_.rig.gimbal.slew_to(here().stop.position_deg, now);
        slew_ordered_ = true;
    }
    switch (ports_.rig.gimbal.update(ports_.rig.platform(), now)) {
        case drivers::GimbalState::in_position:
            ports_.rig.gimbal.release(now);
            if (level_) {
                begin_levelling(now);
            } else {
                begin_dwell(now);
            }
            return now;
        case drivers::GimbalState::timed_out:
            abort("gimbals did not reach the position in time", now);
            return now;
        case drivers::GimbalState::no_status:
            abort("no gimbal status", now);
            return now;
        default:
            return std::min(ports_.rig.gimbal.next_deadline(), now + kStagePoll);
    }
}

void Campaign::begin_dwell(Time now) {
    const double hz =
        here().stop.frequency_hz > 0 ? here().stop.frequency_hz : settings_.frequency_hz;
    dwelling_->aim({here().stop, here().run, here().position, positions_done_ == 0,
                    found_at(proof_.in_step(), hz, settings_.rig)},
                   zeros());
    begin(*dwelling_, State::ramping, now);
}

Time Campaign::dwell(Time now) {
    StageStep step = dwelling_->step(now);
    if (step.kind == Came::asks) {
        if (!gravity_holds(now)) return now + kStagePoll;
        step = dwelling_->ramp(now);
    }
    if (step.kind == Came::failed) {
        abort(step.why, now);
        return now;
    }
    if (state_ == State::ramping && dwelling_->state() != State::ramping) {
        enter(State::settling, now);
    } else {
        state_ = dwelling_->state();
    }
    if (step.kind == Came::going_on) return step.next;
    stage_ = nullptr;
    next_position(now);
    return now;
}

void Campaign::next_position(Time now) {
    ++positions_done_;
    pace_.stop_done(now);
    const auto info = dwelling_->info();
    StopDone stop{here().stop.position_deg,
                  table_g(),
                  repeats_,
                  used_s(now),
                  info.begin_s,
                  dwelling_->utc_ns(),
                  here().stop.frequency_hz,
                  here().stop.verify,
                  info.random.profile,
                  here().stop.sweep.from_hz,
                  here().stop.sweep.to_hz,
                  dwelling_->swept_hz(),
                  {}};
    if (psd_due_) {
        unread_ = Unread{info, std::move(stop), dwelling_->measured_g_rms(),
                         excitation_.power_ratio(*here().stop.random)};
    } else {
        ports_.log.position_done(info, dwells_.back(), stop);
    }
    ++at_;
    enter(State::resting, now);
}

Time Campaign::rest(Time now) {
    switch (excitation_.come_to_rest(now)) {
        case Excitation::Rests::at_rest:
            break;
        case Excitation::Rests::overdue:
            if (!shutting_down_) {
                abort("the shaker did not come to rest in time", now);
                return now;
            }
            ports_.log.event(Severity::alarm, "shaker did not come to rest in time: stop ordered");
            excitation_.order_stop("the ramp down took too long");
            [[fallthrough]];
        case Excitation::Rests::not_yet:
            return now + kStagePoll;
    }
    if (shutting_down_) {
        end(State::aborted, "the daemon is shutting down", now);
        return now;
    }
    if (psd_due_ && !psd_settled(now)) return now + kStagePoll;
    repeat_doubted();
    if (at_ == stops_.size()) {
        const Choice choice = choose_next(now);
        if (choice == Choice::thinking) return now + kStagePoll;
        if (choice == Choice::end) {
            conclude(now);
            return now;
        }
    }
    start_position(now);
    return now;
}

void Campaign::on_dwell_done(const estimator::DwellSummary& summary) {
    dwelling_->done();
    dwells_.push_back(summary);
    if (zeros() != nullptr && zeros()->status().known && at_ < stops_.size()) {
        const double sigma = zeros()->level_sigma(here().stop.position_deg);
        level_variances_.emplace_back(summary.run, sigma * sigma);
    }
    psd_due_ = asks_for_psd(summary);
    if (!psd_due_) count_rejected(summary);
}

void Campaign::count_rejected(const estimator::DwellSummary& summary) {
    rejected_in_a_row_ = summary.left_out ? rejected_in_a_row_ + 1 : 0;
    if (summary.left_out) rejected_for_ = summary.reason;
    if (summary.flagged) {
        ports_.log.event(Severity::warning, fmt::format("run {} position {}: {}", summary.run,
                                                        summary.position, summary.reason));
    }
}

}  // namespace vibrig::campaign
