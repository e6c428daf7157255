// The states of a campaign, and what follows what.
#include "daemon/campaign/campaign.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "daemon/campaign/stages/dwelling.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "daemon/campaign/stages/stop_proof.hpp"
#include "daemon/campaign/stages/waiting.hpp"
#include "daemon/campaign/stages/zero_run.hpp"
#include "daemon/campaign/stages/zeroing.hpp"

namespace vibrig::campaign {

using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {

constexpr Time kPoll = 200 * drivers::kMillisecond;

// The loop that calls step() sleeps for half a second at most. After more than the longest
// standstill people may think that it is over, and be at the table.
constexpr Time kStandstill = 750 * drivers::kMillisecond, kLongestStandstill = 10 * kSecond;
// After one the shaker's link has so long to come back: a request that is answered too late and
// what follows, a connection and a read.
constexpr Time kFreshLook = 2 * kSecond;

constexpr bool kCampaign = true, kPosition = true, kNo = false;

}  // namespace

/// A state: what the interlock watches in it, whether a campaign is under way and whether it is a
/// part of one position (all else is waited for, or done once), and who moves it on.
struct Campaign::StateRow {
    State state;
    rt::Guard guard;
    bool campaign, position;
    Time (Campaign::*step)(Time);
};

const Campaign::StateRow& Campaign::row_of(State state) {
    using G = rt::Guard;
    // clang-format off
    static constexpr std::array kRows{
        StateRow{State::idle,          G::idle,       kNo,       kNo,       &Campaign::stand_by},
        StateRow{State::armed,         G::armed,      kNo,       kNo,       &Campaign::stand_by},
        StateRow{State::waiting,       G::armed,      kCampaign, kNo,       &Campaign::wait},
        StateRow{State::slewing,       G::armed,      kCampaign, kPosition, &Campaign::slew},
        StateRow{State::ramping,       G::excitation, kCampaign, kPosition, &Campaign::dwell},
        StateRow{State::settling,      G::excitation, kCampaign, kPosition, &Campaign::dwell},
        StateRow{State::recording,     G::excitation, kCampaign, kPosition, &Campaign::dwell},
        StateRow{State::resting,       G::excitation, kCampaign, kPosition, &Campaign::rest},
        StateRow{State::paused,        G::armed,      kCampaign, kNo,       &Campaign::pause},
        StateRow{State::finished,      G::idle,       kNo,       kNo,       &Campaign::stand_by},
        StateRow{State::aborted,       G::idle,       kNo,       kNo,       &Campaign::stand_by},
        StateRow{State::tripped,       G::idle,       kNo,       kNo,       &Campaign::stand_by},
        StateRow{State::zeroing,       G::armed,      kCampaign, kNo,       &Campaign::zeroing},
        StateRow{State::levelling,     G::armed,      kCampaign, kPosition, &Campaign::levelling},
        // It begins at rest, and has to learn where the gimbals are.
        StateRow{State::checking,      G::armed,      kNo,       kNo,       &Campaign::check},
        StateRow{State::commissioning, G::idle,       kNo,       kNo,       &Campaign::give_way}};
    // clang-format on
    static_assert(kRows.size() == static_cast<std::size_t>(kLastCampaignState) + 1);
    static_assert([] {
        for (std::size_t i = 0; i < kRows.size(); ++i)
            if (static_cast<std::size_t>(kRows[i].state) != i) return false;
        return true;
    }());
    return kRows[static_cast<std::size_t>(state)];
}

Campaign::Campaign(const Settings& settings, const Ports& ports)
    : settings_(settings),
      ports_(ports),
      stop_(
          ports_.rig.shaker, [this](Time at) { return ports_.rig.rest(at); }, settings_.stop),
      excitation_(settings_, ports_.rig, stop_),
      proof_(settings_.proof) {
    if (!(settings_.sample_s > 0))
        throw std::invalid_argument(fmt::format(
            "campaign: {:g} s between samples found, expected above 0", settings_.sample_s));
    plan_stops();
    excitation_.for_whom(highest_level(), true);
    make_stages();
}

bool Campaign::active() const { return row_of(state_).campaign; }

bool Campaign::done(Time now) const { return shutting_down_ && !active() && !stop_.unsettled(now); }

void Campaign::enter(State state, Time now) {
    state_ = state;
    ports_.rig.shaker.read_only(writes_held_ || state == State::commissioning);
    if (state == State::paused) {
        ports_.rig.gimbal.forget_position();
        paused_steady_ = ports_.log.steady_now();
    }
    excitation_.for_whom(highest_level(), state != State::checking);
    if (state == State::ramping) excitation_.place(here().stop.position_deg);
    if (state == State::ramping || state == State::checking)
        excitation_.from_rest(state == State::ramping ? here().stop : Stop{}, now);
    ports_.rig.commanded(state == State::settling ? table_g() : 0, excitation_.position_deg());
    ports_.rig.guard(row_of(state).guard);
    pace_.enter(row_of(state).position, now);
    entered_ = now;
    slew_ordered_ = false;
    excitation_.begin_part(now);
}

/// From the position after the ones in offer_, which is empty for a new campaign.
void Campaign::begin(const std::string& by, Time now) {
    started_by_ = by;
    ports_.rig.gimbal.forget_position();
    dwells_ = std::exchange(offer_, {});
    positions_done_ = dwells_.size();
    plan_stops();
    static_cast<void>(put_first(dwells_));
    offered_stops_.clear();
    at_ = positions_done_;
    repeat_after_interruption();
    pause_asked_ = false;
    rejected_in_a_row_ = 0;
    psd_due_ = false;
    unread_.reset();
    vibration_off_.clear();
    vibration_off_since_ = -1;
    doubted_.reset();
    zeroed_ = opened_ = false;
    zeroing_ = ZeroingAt::none;
    mark_.clear();
    level_variances_.clear();
    dwelling_->reset(offered_last_);
    if (zero_) zero_->reset();
    started_ = now;
    pace_.begin(now);
    begin(*waiting_, State::waiting, now);
}

bool Campaign::awaits_look(Time now) const {
    const bool may_move = row_of(state_).guard != rt::Guard::armed || state_ == State::checking ||
                          state_ == State::levelling || stop_.excited() || stop_.stopping();
    if (awake_ == 0 || may_move) return false;
    // What was received meanwhile takes a moment, too.
    return now - awake_ < (ports_.rig.shaker.reading().valid ? kPoll : kFreshLook);
}

Time Campaign::step(Time now) {
    const Time last = std::exchange(stepped_, now);
    // One in the midst of a look does not lengthen it: where it is the rule things go on, too.
    if (last > 0 && now - last > kStandstill && !awaits_look(last))
        awake_ = now - last < kLongestStandstill ? now : 0;
    for (;;) {
        const State before = state_;
        const std::size_t at = at_;
        const Time next = step_once(now);
        if (state_ == before && at == at_) return next;
    }
}

Time Campaign::step_once(Time now) {
    watch_stop(now);
    if (proving_->pressed()) proving_->look(state_ == State::tripped, reason_, now);
    // A link that was lost ends the arming: excitation never recovers alone.
    if ((active() || state_ == State::armed || state_ == State::checking) && !shutting_down_ &&
        !zero_run_->hung_up() && !ports_.rig.shaker.reading().valid && !awaits_look(now)) {
        abort("no valid read-back from the shaker", now);
    }
    insist_on_zero_torque(now);
    watch_gimbals(now);
    watch_gravity();
    watch_power();
    watch_arming(now);
    return awaits_look(now) ? now + kPoll : (this->*row_of(state_).step)(now);
}

Time Campaign::wait(Time now) { return opening() ? open(now) : wait_for_platform(now); }

Time Campaign::pause(Time now) {
    if (!pause_asked_ || shutting_down_) start_position(now);
    return now + kSecond;
}

/// An aborted slew's last command is repeated until the platform has it.
Time Campaign::stand_by(Time now) {
    ports_.rig.gimbal.update(ports_.rig.platform(), now);
    return std::min(ports_.rig.gimbal.next_deadline(), now + kSecond);
}

Time Campaign::give_way(Time now) {
    // Its watchdog, which nobody feeds meanwhile, may count at rest, too, and be the fault.
    const auto shaker = ports_.rig.shaker.reading();
    if (!shaker.still() || shaker.running ||
        (shaker.state != drivers::kShakerIdle && shaker.state != drivers::kShakerFault)) {
        abort("the shaker is not at rest, or cannot be read", now);
        return now;
    }
    ports_.rig.gimbal.update(ports_.rig.platform(), now);
    return std::min(ports_.rig.gimbal.next_deadline(), now + kPoll);
}

void Campaign::start_position(Time now) {
    reason_.clear();
    if (shutting_down_) return abort("the daemon is shutting down", now);
    if (pause_asked_) {
        if (state_ != State::paused) {
            ports_.log.event(Severity::info, "paused");
            enter(State::paused, now);
        }
        return;
    }
    if (zero_ && !zeroed_) return begin_zeroing(false, now);
    if (opening_ && settings_.open_first && !opened_) return begin_opening(now);
    if (too_many_rejected(now) || vibration_was_off(now) || not_valid_so_far(now)) return;
    if (at_ == stops_.size()) {
        const Choice choice = choose_next(now);
        // At rest it is asked again.
        if (choice == Choice::thinking) return enter(State::resting, now);
        if (choice == Choice::end) return conclude(now);
    }
    const auto& angle = here().stop.position_deg;
    ports_.log.event(
        Severity::info,
        fmt::format("run {} of {}, position {}: {:g}, {:g}, {:g} deg, {:g} g, dwell {} of {}",
                    here().run, runs(),
                    is_repeat(here()) ? fmt::format("{}, a repeat", here().position)
                                      : fmt::format("{} of {}", here().position, positions()),
                    angle[0], angle[1], angle[2], table_g(), at_ + 1,
                    std::max(expected_, at_ + 1)));
    enter(State::slewing, now);
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
    ports_.dwells.end(true);
    ports_.log.event(Severity::info, "campaign finished");
}

void Campaign::abort(const std::string& why, Time now) {
    excitation_.order_stop(why);
    end(State::aborted, why, now);
}

void Campaign::end(State state, const std::string& why, Time now) {
    const bool had_campaign = active();
    const bool checking = state_ == State::checking;
    const bool commissioning = state_ == State::commissioning;
    const char* const what = opens_alone()      ? "opening check aborted: "
                             : commissioning    ? "commissioning aborted: "
                             : !checking        ? "campaign aborted: "
                             : checks_at_zero() ? "run at 0 g aborted: "
                                                : "loop check aborted: ";
    if (checking) end_check(state, why, now);
    const bool slewing = state_ == State::slewing || state_ == State::zeroing || opening();
    if (psd_due_) close_psd({{}, "the campaign ended before it was read", 0});
    leave_stage();
    zeroing_ = ZeroingAt::none;
    armed_by_.clear();
    reason_ = why;
    enter(state, now);
    if (slewing) ports_.rig.gimbal.release(now);
    if (state == State::tripped) {
        ports_.log.event(Severity::trip, "stop of the shaker ordered: " + why);
    } else {
        ports_.log.event(Severity::alarm, what + why);
    }
    if (had_campaign) ports_.dwells.end(false);
}

void Campaign::on_trip(const std::string& cause, Time now) {
    // Once more: whoever tripped has stopped it already, and a second stop costs one write.
    excitation_.order_stop("interlock: " + cause);
    end(State::tripped, cause, now);
}

void Campaign::shut_down(Time now) {
    if (shutting_down_) return;
    shutting_down_ = true;
    if (proving_->pressed()) proving_->end_pressed("not completed: the daemon is shutting down");
    if (state_ == State::checking || state_ == State::commissioning)
        return abort("the daemon is shutting down", now);
    if (!active()) return;
    const bool slewing = state_ == State::slewing || opening();
    leave_stage();
    if (slewing) ports_.rig.gimbal.release(now);
    if (!stop_.excited()) return end(State::aborted, "the daemon is shutting down", now);
    ports_.log.event(Severity::warning, "shutting down: ramping the shaker down");
    enter(State::resting, now);
}

}  // namespace vibrig::campaign
