#include "daemon/campaign/campaign.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/levelling_stage.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/opening_stage.hpp"
#include "daemon/campaign/zeroing_stage.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kNever;
using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {

constexpr Time kPoll = 200 * drivers::kMillisecond;
// The order of a dwell goes out this long before its first sample; the last part of settling.
constexpr Time kOrderLead = kSecond;
// How much later than the last sample of a dwell the estimator may report it as done.
constexpr Time kDoneGrace = 2 * kSecond;
constexpr double kAtRestG = 1e-9;
// Read back against commanded; a register resolves 1 mHz.
constexpr double kFrequencyToleranceHz = 0.01;

rt::Guard guard_in(State state) {
    switch (state) {
        case State::ramping:
        case State::settling:
        case State::recording:
        case State::resting:
        case State::checking:
            return rt::Guard::excitation;
        case State::armed:
        case State::waiting:
        case State::slewing:
        case State::zeroing:
        case State::levelling:
        case State::paused:
            return rt::Guard::armed;
        default:
            return rt::Guard::idle;
    }
}

}  // namespace

Campaign::Campaign(const Settings& settings, Ports ports)
    : settings_(settings),
      ports_(std::move(ports)),
      stop_(ports_.shaker, ports_.rest, settings_.stop),
      proof_(settings_.proof) {
    plan_stops();
    make_stages();
}

bool Campaign::active() const {
    return state_ == State::waiting || state_ == State::slewing || state_ == State::ramping ||
           state_ == State::settling || state_ == State::recording || state_ == State::resting ||
           state_ == State::zeroing || state_ == State::levelling || state_ == State::paused;
}

bool Campaign::done(Time now) const { return shutting_down_ && !active() && !stop_.unsettled(now); }

std::string Campaign::not_fit_to_excite(Time now) const {
    if (ports_.unfit) {
        if (auto why = ports_.unfit(); !why.empty()) return why;
    }
    const auto reading = ports_.shaker.reading();
    if (ports_.shaker.stop_pending()) return "a stop of the shaker is pending";
    if (stop_.stopping()) {
        const auto why = stop_.what_moves(now);
        return "stopping: rest is not measured yet" + (why.empty() ? why : ": " + why);
    }
    if (!reading.valid) return "no valid read-back from the shaker";
    if (reading.emergency_stop_open) return "the emergency-stop chain is open";
    if (reading.fault != 0 || reading.state == drivers::kShakerFault)
        return fmt::format("shaker fault {:#06x}", reading.fault);
    if (reading.watchdog == drivers::WatchdogTimeout::changed)
        return fmt::format("the controller's watchdog timeout reads {:g} s, not what was written",
                           reading.watchdog_timeout_s);
    if (reading.watchdog == drivers::WatchdogTimeout::unread)
        return "the controller's watchdog timeout has not been read back yet";
    if (!reading.at_rest()) return "the shaker is not at rest";
    if (stop_.rest(now).moving()) return "not at rest: " + stop_.what_moves(now);
    return {};
}

/// What a position is made of; all else is waited for, or done once.
static bool is_stop(CampaignState state) {
    return state == State::slewing || state == State::levelling || state == State::ramping ||
           state == State::settling || state == State::recording || state == State::resting;
}

void Campaign::enter(State state, Time now) {
    state_ = state;
    if (state == State::paused) ports_.gimbal.forget_position();
    if (state == State::ramping) excited_deg_ = here().stop.position_deg;
    if (state == State::ramping || state == State::checking) {
        // From rest: what the table was told last is over, and no witness may hold it to that.
        asked_g_ = 0;
        tell_ramp(0, now);
    }
    if (ports_.commanded) {
        ports_.commanded(state == State::settling ? table_g() : 0, excited_deg_);
    }
    // A loop check begins at rest, and has to learn where the gimbals are.
    ports_.guard(state == State::checking ? rt::Guard::armed : guard_in(state));
    pace_.enter(is_stop(state), now);
    entered_ = now;
    requested_ = false;
    stop_sent_ = false;
}

CommandReply Campaign::command(const CommandRequest& request, Time now) {
    using Kind = CommandRequest::Kind;
    const auto refuse = [&](const std::string& why) { return CommandReply{false, why}; };
    const auto accept = [&](const std::string& text) {
        ports_.event(Severity::info, fmt::format("{} by {}", text, request.by));
        return CommandReply{true, text};
    };
    if (request.by.empty()) return refuse("by: found nothing, expected the name of a person");
    if (shutting_down_) return refuse("the daemon is shutting down");
    switch (request.kind) {
        case Kind::arm:
            if (const auto why = not_fit_to_arm(now); !why.empty()) return refuse(why);
            armed_by_ = request.by;
            armed_under_ = ports_.shaker.stops();
            armed_wall_ = ports_.wall();
            reason_.clear();
            enter(State::armed, now);
            armed_for_ = arming_text(request);
            return accept("armed for " + armed_for_);
        case Kind::start:
            if (active()) return refuse("a campaign is running, started by " + started_by_);
            if (state_ == State::checking) return refuse("a loop check is running");
            if (state_ != State::armed) return refuse("not armed: a named person arms it first");
            if (const auto why = not_fit_to_excite(now); !why.empty()) return refuse(why);
            if (!ports_.estimator_free()) return refuse("the last dwell is still being closed");
            offer_.clear();
            offered_stops_.clear();
            offered_last_.reset();
            ports_.begin();
            begin(request.by, now);
            return accept(started_by_ == armed_by_ ? "campaign started"
                                                   : "campaign started, armed by " + armed_by_);
        case Kind::pause:
            if (!active()) return refuse("no campaign is running");
            pause_asked_ = true;
            return accept("pause before the next position");
        case Kind::resume:
            if (!active() && !offer_.empty()) return resume_interrupted(request, now);
            if (state_ != State::paused && !pause_asked_) return refuse("not paused");
            if (state_ == State::paused) vibration_off_.clear();  // looked at anew
            pause_asked_ = false;
            return accept("resumed");
        case Kind::abort:
            if (active() || state_ == State::armed || state_ == State::checking ||
                state_ == State::commissioning) {
                abort("aborted by " + request.by, now);
            } else {
                order_stop("stopped by " + request.by);
            }
            return accept("stop sent");
        case Kind::acknowledge: {
            // One acknowledgement is for both: the controller latches its faults, too, and forgets
            // them when it is told to stop at rest.
            if (const auto why = not_fit_to_acknowledge(now); !why.empty()) return refuse(why);
            const auto shaker = ports_.shaker.reading();
            const bool changed =
                shaker.valid && shaker.watchdog == drivers::WatchdogTimeout::changed;
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
            if (latched) {
                stopped_by_ = "acknowledged by " + request.by;
                stop_shaker();
            }
            return accept("acknowledged: " + what);
        }
        case Kind::selftest:
            return begin_loop_check(request, now);
        case Kind::commission:  // the daemon's, by begin_commissioning()
            break;
    }
    return refuse("unknown command");
}

/// From the position after the ones in offer_, which is empty for a new campaign.
void Campaign::begin(const std::string& by, Time now) {
    started_by_ = by;
    ports_.gimbal.forget_position();
    dwells_ = std::exchange(offer_, {});
    positions_done_ = positions_before_ = dwells_.size();
    plan_stops();
    static_cast<void>(put_first(dwells_));
    offered_stops_.clear();
    at_ = positions_done_;
    repeat_after_interruption();
    temperatures_.clear();
    pause_asked_ = false;
    rejected_in_a_row_ = 0;
    vibration_off_.clear();
    vibration_off_since_ = -1;
    doubted_.reset();
    zeroed_ = opened_ = false;
    zeroing_ = Zeroing::none;
    mark_.clear();
    level_variances_.clear();
    origin_.reset();
    if (zero_) zero_->reset();
    started_ = now;
    pace_.begin(now);
    enter(State::waiting, now);
}

Time Campaign::step(Time now) {
    for (;;) {
        const State before = state_;
        const std::size_t at = at_;
        const Time next = step_once(now);
        if (state_ == before && at == at_) return next;
    }
}

Time Campaign::step_once(Time now) {
    watch_stop(now);
    if (pressed_ != Pressed::no) await_pressed(now);
    // A link that was lost ends the arming: excitation never recovers alone.
    if ((active() || state_ == State::armed || state_ == State::checking) && !shutting_down_ &&
        !ports_.shaker.reading().valid) {
        abort("no valid read-back from the shaker", now);
    }
    insist_on_zero_torque(now);
    watch_gravity();
    watch_power();
    watch_arming(now);
    switch (state_) {
        case State::waiting:
            return opening() ? open(now) : wait_for_platform(now);
        case State::zeroing:
            return zeroing(now);
        case State::levelling:
            return levelling(now);
        case State::checking:
            return check_loop(now);
        case State::slewing:
            return slew(now);
        case State::ramping:
            return ramp(now);
        case State::settling:
        case State::recording:
            return record(now);
        case State::resting:
            return rest(now);
        case State::paused:
            if (!pause_asked_ || shutting_down_) start_position(now);
            return now + kSecond;
        case State::commissioning:
            if (!ports_.shaker.reading().at_rest()) {
                abort("the shaker is not at rest, or cannot be read", now);
                return now;
            }
            ports_.gimbal.update(ports_.platform(), now);
            return std::min(ports_.gimbal.next_deadline(), now + kPoll);
        case State::idle:
        case State::armed:
        case State::finished:
        case State::aborted:
        case State::tripped:
            // An aborted slew's last command is repeated until the platform has it.
            ports_.gimbal.update(ports_.platform(), now);
            return std::min(ports_.gimbal.next_deadline(), now + kSecond);
    }
    return now + kSecond;
}

void Campaign::start_position(Time now) {
    reason_.clear();
    if (shutting_down_) return abort("the daemon is shutting down", now);
    if (pause_asked_) {
        if (state_ != State::paused) {
            ports_.event(Severity::info, "paused");
            enter(State::paused, now);
        }
        return;
    }
    if (zero_ && !zeroed_) return begin_zeroing(false, now);
    if (opening_ && !opened_) return begin_opening(now);
    if (too_many_rejected(now) || vibration_was_off(now) || not_valid_so_far(now)) return;
    if (at_ == stops_.size()) {
        const Choice choice = choose_next(now);
        // At rest it is asked again.
        if (choice == Choice::thinking) return enter(State::resting, now);
        if (choice == Choice::end) return conclude(now);
    }
    const auto& angle = here().stop.position_deg;
    ports_.event(
        Severity::info,
        fmt::format("run {} of {}, position {}: {:g}, {:g}, {:g} deg, {:g} g, dwell {} of {}",
                    here().run, runs(),
                    is_repeat(here()) ? fmt::format("{}, a repeat", here().position)
                                      : fmt::format("{} of {}", here().position, positions()),
                    angle[0], angle[1], angle[2], table_g(), at_ + 1,
                    std::max(expected_, at_ + 1)));
    enter(State::slewing, now);
}

Time Campaign::slew(Time now) {
    // Gimbals never slew on a moving shaker, whoever moves it.
    if (!ports_.shaker.reading().at_rest() || (!requested_ && stop_.rest(now).moving())) {
        if (requested_) {
            abort("the shaker left rest during a slew", now);
        } else {
            enter(State::resting, now);
        }
        return now;
    }
    if (!requested_) {
        if (const auto why = may_slew(); !why.empty()) {
            abort(why, now);
            return now;
        }
        ports_.gimbal.slew_to(here().stop.position_deg, now);
        requested_ = true;
    }
    switch (ports_.gimbal.update(ports_.platform(), now)) {
        case drivers::GimbalState::in_position:
            ports_.gimbal.release(now);
            part_ = Part::go;
            enter(level_ ? State::levelling : State::ramping, now);
            return now;
        case drivers::GimbalState::timed_out:
            abort("gimbals did not reach the position in time", now);
            return now;
        case drivers::GimbalState::no_status:
            abort("no gimbal status", now);
            return now;
        default:
            return std::min(ports_.gimbal.next_deadline(), now + kPoll);
    }
}

bool Campaign::vibrating_as_commanded(const drivers::ShakerReading& reading, double table_g) const {
    return reading.valid && reading.running && reading.state == drivers::kShakerRunning &&
           std::abs(reading.frequency_hz - settings_.frequency_hz) <= kFrequencyToleranceHz &&
           std::abs(reading.measured_g - table_g) <= settings_.amplitude_tolerance * table_g;
}

/// A stop of another thread comes before the word of who ordered it and why, which is to be the
/// reason; for so long it is waited for.
bool Campaign::stopped_by_another(Time now) {
    if (ports_.shaker.stops() == armed_under_) return false;
    if (stopped_under_ != ports_.shaker.stops()) {
        stopped_under_ = ports_.shaker.stops();
        stopped_since_ = now;
    }
    return now - stopped_since_ < drivers::kSecond;
}

Time Campaign::ramp(Time now) {
    const auto gimbal = ports_.gimbal.update(ports_.platform(), now);
    if (gimbal == drivers::GimbalState::commanding)
        return std::min(ports_.gimbal.next_deadline(), now + kPoll);
    if (gimbal != drivers::GimbalState::idle) {
        abort(fmt::format("gimbals not released: {}", drivers::name_of(gimbal)), now);
        return now;
    }
    if (!requested_ && !gravity_holds(now)) return now + kPoll;
    if (table_g() <= kAtRestG) {
        enter(State::settling, now);
        return now;
    }
    if (!requested_) {
        requested_ = ask_level(table_g(), now);
        if (!requested_) abort("the shaker takes no set-point", now);
        return now + kPoll;
    }
    if (!ports_.shaker.busy() && vibrating_as_commanded(ports_.shaker.reading(), table_g())) {
        enter(State::settling, now);
        return now;
    }
    if (now - entered_ > from_seconds(settings_.ramp_s) + kRampGrace) {
        const auto reading = ports_.shaker.reading();
        abort(fmt::format("shaker: measured {:.3f} g, expected {:g} g within {:g} %",
                          reading.measured_g, table_g(), 100 * settings_.amplitude_tolerance),
              now);
    }
    return now + kPoll;
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
        if (zero_) {
            order.zero_g = zero_->raw_zero_g();
            order.level_sigma_g = zero_->level_sigma(here().stop.position_deg);
        }
        if (!ports_.order_dwell(order)) abort("the estimator takes no order", now);
        return now + kPoll;
    }
    if (table_g() > kAtRestG && !vibrating_as_commanded(ports_.shaker.reading(), table_g()) &&
        !stopped_by_another(now)) {
        const auto reading = ports_.shaker.reading();
        abort(fmt::format("shaker off command: state {}, measured {:.3f} g, expected {:g} g",
                          reading.state, reading.measured_g, table_g()),
              now);
        return now;
    }
    if (torquing()) {
        abort("the platform is torqued during a dwell, expected free drift", now);
        return now;
    }
    if (state_ == State::settling) {
        if (now < dwell_from_) return std::min(dwell_from_, now + kPoll);
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
    return std::min(now < dwell_to_ ? dwell_to_ : now + kPoll, now + kPoll);
}

void Campaign::next_position(Time now) {
    ++positions_done_;
    pace_.stop_done(now);
    if (ports_.position_done) {
        ports_.position_done(dwell_info(), dwells_.back(),
                             {here().stop.position_deg, table_g(), repeats_, used_s(now),
                              dwell_info().begin_s, dwell_utc_ns_});
    }
    ++at_;
    enter(State::resting, now);
}

Time Campaign::rest(Time now) {
    if (!come_to_rest(now)) return now + kPoll;
    if (shutting_down_) {
        end(State::aborted, "the daemon is shutting down", now);
        return now;
    }
    repeat_doubted();
    if (at_ == stops_.size()) {
        const Choice choice = choose_next(now);
        if (choice == Choice::thinking) return now + kPoll;
        if (choice == Choice::end) {
            conclude(now);
            return now;
        }
    }
    start_position(now);
    return now;
}

void Campaign::conclude(Time now) {
    if (positions_done_ == 0) {
        armed_by_.clear();
        return end(State::aborted, "nothing to do", now);
    }
    if (zero_) return begin_zeroing(true, now);
    finish(now);
}

void Campaign::finish(Time now) {
    --at_;
    expected_ = stops_.size();
    armed_by_.clear();
    enter(State::finished, now);
    ports_.end(true);
    ports_.event(Severity::info, "campaign finished");
}

void Campaign::leave_dwell() {
    if (std::exchange(dwell_ordered_, false)) {
        rt::DwellOrder cancel;
        cancel.cancel = true;
        static_cast<void>(ports_.order_dwell(cancel));
    }
}

void Campaign::abort(const std::string& why, Time now) {
    order_stop(why);
    end(State::aborted, why, now);
}

void Campaign::end(State state, const std::string& why, Time now) {
    const bool had_campaign = active();
    const bool checking = state_ == State::checking;
    const bool commissioning = state_ == State::commissioning;
    if (checking) {
        loop_->not_completed(why);
        if (check_ == Check::press && ports_.shaker.reading().emergency_stop_open) {
            begin_pressed(now);
        } else {
            conclude_proof("not completed: " + why + suspect_unit());
        }
    }
    const bool slewing = state_ == State::slewing || state_ == State::zeroing || opening();
    if (opening_) opening_->end();
    leave_dwell();
    leave_stage();
    zeroing_ = Zeroing::none;
    armed_by_.clear();
    reason_ = why;
    enter(state, now);
    if (slewing) ports_.gimbal.release(now);
    if (state == State::tripped) {
        ports_.event(Severity::trip, "stop of the shaker ordered: " + why);
    } else {
        ports_.event(Severity::alarm, (checking        ? "loop check aborted: "
                                       : commissioning ? "commissioning aborted: "
                                                       : "campaign aborted: ") +
                                          why);
    }
    if (had_campaign) ports_.end(false);
}

void Campaign::on_dwell_done(const estimator::DwellSummary& summary) {
    dwell_done_ = true;
    dwells_.push_back(summary);
    if (zero_ && zero_->status().known && at_ < stops_.size()) {
        const double sigma = zero_->level_sigma(here().stop.position_deg);
        level_variances_.emplace_back(summary.run, sigma * sigma);
    }
    rejected_in_a_row_ = summary.left_out ? rejected_in_a_row_ + 1 : 0;
    if (summary.left_out) rejected_for_ = summary.reason;
    if (summary.flagged) {
        ports_.event(Severity::warning, fmt::format("run {} position {}: {}", summary.run,
                                                    summary.position, summary.reason));
    }
}

void Campaign::on_trip(const std::string& cause, Time now) {
    // Once more: whoever tripped has stopped it already, and a second stop costs one write.
    order_stop("interlock: " + cause);
    end(State::tripped, cause, now);
}

void Campaign::shut_down(Time now) {
    if (shutting_down_) return;
    shutting_down_ = true;
    if (pressed_ != Pressed::no) end_pressed("not completed: the daemon is shutting down");
    if (state_ == State::checking || state_ == State::commissioning)
        return abort("the daemon is shutting down", now);
    if (!active()) return;
    leave_dwell();
    leave_stage();
    if (state_ == State::slewing || opening()) ports_.gimbal.release(now);
    if (!stop_.excited()) return end(State::aborted, "the daemon is shutting down", now);
    ports_.event(Severity::warning, "shutting down: ramping the shaker down");
    enter(State::resting, now);
}

}  // namespace vibrig::campaign
