// One position of the campaign: slew, ramp, settle, record, rest.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/stages/levelling.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "daemon/campaign/stages/zeroing.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {

constexpr Time kDwellPoll = 200 * drivers::kMillisecond;
// The order of a dwell goes out this long before its first sample; the last part of settling.
constexpr Time kOrderLead = kSecond;
// How much later than the last sample of a dwell the estimator may report it as done.
constexpr Time kDoneGrace = 2 * kSecond;
constexpr double kAtRestG = 1e-9;
// Read back against commanded; a register resolves 1 mHz.
constexpr double kFrequencyToleranceHz = 0.01;

}  // namespace

Time Campaign::slew(Time now) {
    // Gimbals never slew on a moving shaker, whoever moves it.
    if (!ports_.rig.shaker.reading().at_rest() || (!requested_ && stop_.rest(now).moving())) {
        if (requested_) {
            abort("the shaker left rest during a slew", now);
        } else {
            enter(State::resting, now);
        }
        return now;
    }
    if (!requested_) {
        if (const auto why = may_slew(ports_.rig, stop_); !why.empty()) {
            abort(why, now);
            return now;
        }
        ports_.rig.gimbal.slew_to(here().stop.position_deg, now);
        requested_ = true;
    }
    switch (ports_.rig.gimbal.update(ports_.rig.platform(), now)) {
        case drivers::GimbalState::in_position:
            ports_.rig.gimbal.release(now);
            if (level_) {
                begin_levelling(now);
            } else {
                enter(State::ramping, now);
            }
            return now;
        case drivers::GimbalState::timed_out:
            abort("gimbals did not reach the position in time", now);
            return now;
        case drivers::GimbalState::no_status:
            abort("no gimbal status", now);
            return now;
        default:
            return std::min(ports_.rig.gimbal.next_deadline(), now + kDwellPoll);
    }
}

Time Campaign::ramp(Time now) {
    const auto gimbal = ports_.rig.gimbal.update(ports_.rig.platform(), now);
    if (gimbal == drivers::GimbalState::commanding)
        return std::min(ports_.rig.gimbal.next_deadline(), now + kDwellPoll);
    if (gimbal != drivers::GimbalState::idle) {
        abort(fmt::format("gimbals not released: {}", drivers::name_of(gimbal)), now);
        return now;
    }
    if (!requested_ && !gravity_holds(now)) return now + kDwellPoll;
    if (!requested_ && !frequency_may_change(now)) return now + kDwellPoll;
    if (table_g() <= kAtRestG) {
        enter(State::settling, now);
        return now;
    }
    if (!requested_) {
        requested_ = ask_level(table_g(), now);
        if (!requested_) abort("the shaker takes no set-point", now);
        return now + kDwellPoll;
    }
    if (!ports_.rig.shaker.busy() &&
        vibrating_as_commanded(ports_.rig.shaker.reading(), table_g())) {
        enter(State::settling, now);
        return now;
    }
    if (now - entered_ > from_seconds(settings_.ramp_s) + kRampGrace) {
        const auto reading = ports_.rig.shaker.reading();
        abort(fmt::format("shaker: measured {:.3f} g, expected {:g} g within {:g} %",
                          reading.measured_g, table_g(), 100 * settings_.amplitude_tolerance),
              now);
    }
    return now + kDwellPoll;
}

Time Campaign::record(Time now) {
    if (!dwell_ordered_) {
        // On a whole millisecond: how often clocks were read on the way here does not show.
        const Time settled = entered_ + std::max(from_seconds(settings_.settle_s), kOrderLead);
        dwell_from_ =
            (settled + drivers::kMillisecond - 1) / drivers::kMillisecond * drivers::kMillisecond;
        dwell_to_ = dwell_from_ + from_seconds(settings_.dwell_s);
        dwell_done_ = false;
        dwell_ordered_ = true;
        rt::DwellOrder order;
        order.from = dwell_from_;
        order.to = dwell_to_;
        dwell_utc_ns_ = utc_ns() + (dwell_from_ - now);
        if (!origin_) take_over_origin();
        order.dwell = dwell_info();
        if (const auto* const found = zeros()) {
            order.zero_g = found->raw_zero_g();
            order.level_sigma_g = found->level_sigma(here().stop.position_deg);
        }
        watch_vibration();
        if (!ports_.dwells.order(order)) abort("the estimator takes no order", now);
        return now + kDwellPoll;
    }
    if (table_g() > kAtRestG && !vibrating_as_commanded(ports_.rig.shaker.reading(), table_g()) &&
        !stopped_by_another(now)) {
        const auto reading = ports_.rig.shaker.reading();
        abort(fmt::format("shaker off command: state {}, measured {:.3f} g, expected {:g} g",
                          reading.state, reading.measured_g, table_g()),
              now);
        return now;
    }
    if (torquing(ports_.rig)) {
        abort("the platform is torqued during a dwell, expected free drift", now);
        return now;
    }
    if (state_ == State::settling) {
        look_at_vibration(now);
        if (now < dwell_from_) return std::min(dwell_from_, now + kDwellPoll);
        state_ = State::recording;
    }
    if (dwell_done_) {
        dwell_ordered_ = power_lost_ = false;
        next_position(now);
        return now;
    }
    if (now > dwell_to_ + kDoneGrace) {
        abort("samples ceased during the dwell", now);
        return now;
    }
    return std::min(now < dwell_to_ ? dwell_to_ : now + kDwellPoll, now + kDwellPoll);
}

void Campaign::next_position(Time now) {
    ++positions_done_;
    pace_.stop_done(now);
    ports_.log.position_done(
        dwell_info(), dwells_.back(),
        {here().stop.position_deg, table_g(), repeats_, used_s(now), dwell_info().begin_s,
         dwell_utc_ns_, here().stop.frequency_hz, here().stop.verify});
    ++at_;
    enter(State::resting, now);
}

Time Campaign::rest(Time now) {
    if (!come_to_rest(now)) return now + kDwellPoll;
    if (shutting_down_) {
        end(State::aborted, "the daemon is shutting down", now);
        return now;
    }
    repeat_doubted();
    if (at_ == stops_.size()) {
        const Choice choice = choose_next(now);
        if (choice == Choice::thinking) return now + kDwellPoll;
        if (choice == Choice::end) {
            conclude(now);
            return now;
        }
    }
    start_position(now);
    return now;
}

void Campaign::leave_dwell() {
    if (std::exchange(watching_, false)) ports_.rig.feed->order(rt::StageFeed::Mode::off);
    if (std::exchange(dwell_ordered_, false)) {
        rt::DwellOrder cancel;
        cancel.cancel = true;
        static_cast<void>(ports_.dwells.order(cancel));
    }
}

void Campaign::on_dwell_done(const estimator::DwellSummary& summary) {
    dwell_done_ = true;
    dwells_.push_back(summary);
    if (zeros() != nullptr && zeros()->status().known && at_ < stops_.size()) {
        const double sigma = zeros()->level_sigma(here().stop.position_deg);
        level_variances_.emplace_back(summary.run, sigma * sigma);
    }
    rejected_in_a_row_ = summary.left_out ? rejected_in_a_row_ + 1 : 0;
    if (summary.left_out) rejected_for_ = summary.reason;
    if (summary.flagged) {
        ports_.log.event(Severity::warning, fmt::format("run {} position {}: {}", summary.run,
                                                        summary.position, summary.reason));
    }
}

bool Campaign::vibrating_as_commanded(const drivers::ShakerReading& reading, double table_g) const {
    return reading.valid && reading.running && reading.state == drivers::kShakerRunning &&
           std::abs(reading.frequency_hz - excited_hz_) <= kFrequencyToleranceHz &&
           std::abs(reading.measured_g - table_g) <= settings_.amplitude_tolerance * table_g;
}

/// A stop of another thread comes before the word of who ordered it and why, which is to be the
/// reason; for so long it is waited for.
bool Campaign::stopped_by_another(Time now) {
    if (ports_.rig.shaker.stops() == armed_under_) return false;
    if (stopped_under_ != ports_.rig.shaker.stops()) {
        stopped_under_ = ports_.rig.shaker.stops();
        stopped_since_ = now;
    }
    return now - stopped_since_ < drivers::kSecond;
}

}  // namespace vibrig::campaign
