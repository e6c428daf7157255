// The safe-state proof: after the loop check at a small level the table is stopped by order, then
// by starving its watchdog, and if a person presses it by the emergency stop; each is timed by
// those who can tell, never by the controller's word alone.
#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/safety_proof.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "estimator/level/ring_down.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::Time;
using drivers::to_seconds;

namespace {
// A person's time, not the rig's: how long there is to press the emergency stop, and then to close
// its chain again.
constexpr Time kPress = 60 * drivers::kSecond;
// How long nothing may start with the chain closed.
constexpr Time kClosed = 3 * drivers::kSecond;
// What is called rest has to be so many times the noise.
constexpr double kNoises = 6;
}  // namespace

void StopTimes::begin(Time now) {
    *this = {};
    from_ = now;
}

void StopTimes::look(const drivers::ShakerReading& reading, const rt::Rest& rest) {
    if (!controller_s && reading.valid && reading.time > from_ && !reading.running &&
        reading.still())
        controller_s = to_seconds(reading.time - from_);
    const auto stands = [this](const rt::RestWitness& witness, std::optional<double>& time_s) {
        if (!time_s && witness.verdict == rt::RestVerdict::still && witness.from >= from_)
            time_s = to_seconds(witness.from - from_);
    };
    stands(rest.table, table_s);
    stands(rest.platform, platform_s);
    table_known = table_known || rest.table.verdict != rt::RestVerdict::absent;
}

/// From the table's last motion on: what the pads do by themselves.
void Campaign::keep_ring_down() {
    const double from_s = stop_times_.table_stood_s();
    const auto found =
        estimator::ring_down(loop_->readings_since(stop_times_.from() + from_seconds(from_s)),
                             6 * settings_.rig.accelerometer_g);
    auto& record = proof_.record();
    record.pads = {settings_.loop.table_g, stop_times_.platform_s.value_or(0) - from_s,
                   found.rate_per_s};
    record.pads_hz = found.frequency_hz;
    record.pads_damping = found.damping;
}

void Campaign::take_over_proofs(std::vector<ProofRecord> history) {
    proof_.take_over(std::move(history));
    stop_.pads(proof_.pads());
    // The witnesses go on with what was measured; a key that has changed since asks for a new one.
    const auto transmission = proof_.transmission();
    if (!transmission) return;
    ports_.rig.transmission(*transmission);
    ports_.log.event(Severity::info,
                     fmt::format("transmission {:.4g}, as the loop check of the newest "
                                 "proof measured it",
                                 *transmission));
}

void Campaign::order_proved_stop(Time now) {
    stopped_by_ = "the proof";
    go_on_to(Check::stop, now);
    loop_->measure();
    stop_times_.begin(now);
    stop_shaker();
}

/// Rest by order: when all who can tell have said so, or the stop monitor has given up.
void Campaign::prove_stop(Time now) {
    stop_times_.look(ports_.rig.shaker.reading(), stop_.rest(now));
    if (stop_.disobeyed()) return abort("a stop was not obeyed in its time", now);
    if (const auto reading = ports_.rig.shaker.reading();
        reading.valid && reading.time > stop_times_.from() && reading.fault != 0) {
        return abort(fmt::format("the order to stop was not obeyed: the controller has stopped by "
                                 "itself with fault {:#06x}, its watchdog is not fed meanwhile",
                                 reading.fault),
                     now);
    }
    if (stop_.stopping()) return;
    const double deadline_s = settings_.stop.deadline_s;
    proof_.row("stop, controller", "s", stop_times_.controller_s.value_or(1e3), 0, deadline_s);
    if (stop_times_.table_known)
        proof_.row("stop, table", "s", stop_times_.table_s.value_or(1e3), 0, deadline_s);
    proof_.row("stop, platform", "s", stop_times_.platform_s.value_or(1e3), 0,
               deadline_s + PadRingDown{}.from_s(settings_.loop.table_g));
    keep_ring_down();
    if (!loop_->out_of_band().empty()) return go_on_to(Check::rest, now);  // no more of this
    go_on_to(Check::again, now);
}

/// What the amplitude has to do with the command where the check ended before it was steady.
std::string Campaign::suspect_unit() const {
    if (check_ != Check::ramp || asked_at_ == 0) return {};
    const double ratio = loop_->over_command(asked_at_, settings_.ramp_s);
    const auto suspect = unit_of_ratio(ratio);
    return suspect.empty() ? "" : fmt::format("; {:.2f} times the command: {}", ratio, suspect);
}

void Campaign::proving(Proving what) { ports_.rig.proving(what); }

/// The one fault that is made on purpose: the watchdog is not fed.
void Campaign::prove_watchdog(Time now) {
    if (!std::exchange(requested_, true)) {
        ports_.log.event(Severity::warning,
                         fmt::format("proof: the watchdog is not fed now; the table has to stop by "
                                     "itself within {:g} s",
                                     settings_.watchdog_timeout_s + settings_.stop.deadline_s));
        stop_times_.begin(now);
    }
    const auto reading = ports_.rig.shaker.reading();
    const auto rest = stop_.rest(now);
    stop_times_.look(reading, rest);
    const double waited_s = to_seconds(now - stop_times_.from());
    const double longest_s = settings_.watchdog_timeout_s + stop_.longest_s(settings_.loop.table_g);
    if (rest.measured_since(stop_times_.from()) && reading.state == drivers::kShakerFault) {
        // Fed at most one period before; what stops much earlier was stopped by something else.
        proof_.row("watchdog, rest", "s",
                   stop_times_.table_s.value_or(stop_times_.platform_s.value_or(1e3)),
                   0.5 * settings_.watchdog_timeout_s,
                   stop_times_.table_known
                       ? settings_.watchdog_timeout_s + settings_.stop.deadline_s
                       : longest_s);
        proof_.row("watchdog, the controller says fault", true);
        stopped_by_ = "the proof, to clear the watchdog's fault";
        go_on_to(Check::clear, now);
        stop_shaker();
    } else if (waited_s > longest_s) {
        const bool still = rest.measured_since(stop_times_.from());
        proof_.row("watchdog, rest", "s", still ? waited_s : 1e3, 0, longest_s);
        proof_.row("watchdog, the controller says fault", reading.state == drivers::kShakerFault);
        abort(still
                  ? "the watchdog was not fed, the table stands, but the controller says no fault"
                  : "the watchdog was not fed and the table did not stop: " + stop_.what_moves(now),
              now);
    }
}

void Campaign::prove_clearing(Time now) {
    const auto reading = ports_.rig.shaker.reading();
    const bool cleared =
        !stop_.stopping() && reading.time > entered_ && reading.at_rest() && reading.fault == 0;
    if (!cleared && now - entered_ <= from_seconds(2 * stop_.longest_s(settings_.loop.table_g)))
        return;
    proof_.row("watchdog, fault acknowledged", cleared);
    go_on_to(cleared && press_wanted_ ? Check::press_ramp : Check::rest, now);
}

/// The hard-wired stop. Its opening trips as ever; on_trip() finds it here.
void Campaign::prove_emergency_stop(Time now) {
    if (!std::exchange(requested_, true)) {
        asked_wall_ = ports_.log.wall();
        ports_.log.event(Severity::warning,
                         fmt::format("proof: press the emergency stop{} now, within {:.0f} s",
                                     proof_.named_button(), to_seconds(kPress)));
    }
    if (ports_.log.wall() - asked_wall_ > kPress) abort("nobody pressed the emergency stop", now);
}

/// The opened chain has tripped, or first the witnesses of the table's fall, between two looks at
/// the chain's register: whether that shows it in time, counted from the fall.
void Campaign::begin_pressed(Time now) {
    rt::Motion motion;
    while (take_motion(motion, now)) loop_->add(motion);
    pressed_ = Pressed::rest;
    pressed_at_ = now;
    press_felt_ = false;
    stop_times_.begin(now);
    press_seen_ = false;
    see_pressed(now);
}

void Campaign::see_pressed(Time now) {
    const auto reading = ports_.rig.shaker.reading();
    if (press_seen_ || !reading.valid || !reading.emergency_stop_open) return;
    press_seen_ = true;
    const Time fell = loop_->last_at_half();
    proof_.row("emergency stop, seen", "s", std::max(0.0, to_seconds(now - fell)), 0,
               settings_.proof.seen_s);
}

/// After the trip: those who can tell, the button's own latch, and that closing the chain starts
/// nothing.
void Campaign::await_pressed(Time now) {
    const auto reading = ports_.rig.shaker.reading();
    const auto rest = stop_.rest(now);
    if (pressed_ == Pressed::rest) {
        stop_times_.look(reading, rest);
        see_pressed(now);
        press_felt_ =
            press_felt_ || (reading.valid && reading.time > pressed_at_ &&
                            (reading.fault != 0 || reading.state == drivers::kShakerFault));
        if (stop_.stopping() && !stop_.disobeyed()) return;
        if (!press_seen_) return end_pressed("not completed: " + reason_);
        const double limit_s = stop_.longest_s(settings_.loop.table_g);
        proof_.row("emergency stop, rest", "s", stop_times_.platform_s.value_or(1e3), 0, limit_s);
        proof_.row("emergency stop, latched", state_ == CampaignState::tripped);
        // A contact alone cuts nothing: the trip's own stop brings the table to rest as well.
        proof_.row("emergency stop, the controller says fault", press_felt_);
        proof_.record().emergency_stop = true;
        pressed_ = Pressed::open;
        asked_wall_ = ports_.log.wall();
        if (reading.emergency_stop_open)
            ports_.log.event(Severity::warning, "proof: close the emergency-stop chain again");
    }
    if (pressed_ == Pressed::open) {
        if (ports_.log.wall() - asked_wall_ > kPress)
            return end_pressed("nobody closed the emergency-stop chain again");
        if (!reading.valid || reading.emergency_stop_open) return;
        pressed_ = Pressed::closed;
        pressed_at_ = now;
    }
    const bool starts = reading.valid && (reading.running || !reading.still());
    if (starts || rest.moving() || now - pressed_at_ >= kClosed) {
        proof_.row("closing the chain starts nothing", !starts && !rest.moving());
        end_pressed({});
    }
}

void Campaign::end_pressed(const std::string& why) {
    pressed_ = Pressed::no;
    conclude_proof(why);
}

/// Rest is called by what is well above the noise of those who call it.
void Campaign::prove_quiet() {
    loop_->rests();
    const auto noise = loop_->noise();
    const double limit_g = settings_.rest.limit_g / kNoises;
    if (noise.table_g > 0) proof_.row("noise at rest, table", "g", noise.table_g, 0, limit_g);
    proof_.row("noise at rest, platform", "g", noise.platform_g, 0, limit_g);
}

/// Every order that must not be followed while the table moves, tried.
void Campaign::prove_refusals(Time now) {
    const auto tried = command({CommandRequest::Kind::arm, proof_.record().by, ""}, now);
    proof_.row("arming is refused while it moves", !tried.accepted);
    proof_.row("a slew is refused while it moves", !may_slew(ports_.rig, stop_).empty());
    const bool taken = ports_.rig.shaker.request(
        {settings_.frequency_hz + 1, settings_.loop.table_g, settings_.ramp_s}, armed_under_);
    proof_.row("another frequency is refused while it moves", !taken);
}

void Campaign::conclude_proof(const std::string& why) {
    proving(Proving::nothing);
    const auto& record = proof_.conclude(utc_ns(), why);
    if (record.passed) stop_.pads(record.pads);
    for (const auto& row : record.rows) {
        ports_.log.event(
            row.passed() ? Severity::info : Severity::alarm,
            fmt::format("proof: {} {:.4g}{}{}, expected {:.4g} to {:.4g}", row.name, row.value,
                        row.unit.empty() ? "" : " ", row.unit, row.low, row.high));
    }
    ports_.log.event(record.passed ? Severity::info : Severity::alarm,
                     record.passed ? "the safe state is proved"
                                   : "the safe state is not proved: " + record.message);
    if (const auto trend = proof_.trend(); !trend.empty())
        ports_.log.event(Severity::warning, "proof: " + trend);
    ports_.log.proved(record);
}

}  // namespace vibrig::campaign
