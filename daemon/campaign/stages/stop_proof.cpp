#include "daemon/campaign/stages/stop_proof.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::Time;
using drivers::to_seconds;

namespace {
// A person's time, not the rig's: how long there is to press the emergency stop, and then to close
// its chain again.
constexpr Time kPress = 60 * drivers::kSecond;
// How long nothing may start with the chain closed.
constexpr Time kClosed = 10 * drivers::kSecond;
}  // namespace

void StopProof::go_on_to(Part part, Time now) {
    part_ = part;
    begun_ = false;
    level_.begin_part(part == Part::press,
                      part == Part::stop || part == Part::clear ? Proving::stop
                      : part == Part::watchdog                  ? Proving::watchdog
                                                                : Proving::nothing,
                      now);
}

void StopProof::begin(Time now) {
    go_on_to(Part::stop, now);
    level_.loop.measure();
    times_.begin(now);
    level_.excitation.stop("the proof");
}

void StopProof::begin_at_zero(Time now) { go_on_to(Part::press_ramp, now); }

double StopProof::table_g() const {
    return part_ == Part::none || part_ == Part::rest ? 0 : level_.level_g;
}

StageStep StopProof::step(Time now) {
    std::string why = level_.lacks(now);
    if (why.empty() && part_ == Part::press) why = level_.off_command(now);
    if (!why.empty()) return StageStep::failed(std::move(why));
    switch (part_) {
        case Part::none:
            break;
        case Part::stop:
            why = stopped(now);
            break;
        case Part::again:
            why = climb(Part::watchdog, now);
            break;
        case Part::watchdog:
            why = starved(now);
            break;
        case Part::clear:
            why = cleared(now);
            break;
        case Part::press_ramp:
            why = climb(Part::press, now);
            break;
        case Part::press:
            why = press(now);
            break;
        case Part::rest:
            return level_.come_to_rest(now);
    }
    return why.empty() ? StageStep::going_on(now + kStagePoll) : StageStep::failed(std::move(why));
}

std::string StopProof::climb(Part then, Time now) {
    bool reached = false;
    auto why = level_.excitation.climb(level_.level_g, now, reached);
    if (reached) go_on_to(then, now);
    return why;
}

/// From the table's last motion on: what the pads do by themselves.
void StopProof::keep_ring_down() {
    const double from_s = times_.table_stood_s();
    const auto found = level_.loop.ring_down_since(times_.from() + from_seconds(from_s));
    auto& record = level_.proof.record();
    record.pads = {level_.level_g, times_.platform_s.value_or(0) - from_s, found.rate_per_s};
    record.pads_hz = found.frequency_hz;
    record.pads_damping = found.damping;
}

/// Rest by order: when all who can tell have said so, or the stop monitor has given up.
std::string StopProof::stopped(Time now) {
    const auto& stop = level_.stop;
    const auto reading = level_.ports.rig.shaker.reading();
    times_.look(reading, stop.rest(now));
    if (stop.disobeyed()) return "a stop was not obeyed in its time";
    if (reading.valid && reading.time > times_.from() && reading.fault != 0) {
        return fmt::format(
            "the order to stop was not obeyed: the controller has stopped by itself with fault "
            "{:#06x}, its watchdog is not fed meanwhile",
            reading.fault);
    }
    if (stop.stopping()) return {};
    auto& proof = level_.proof;
    const double deadline_s = level_.settings.stop.deadline_s;
    proof.row("stop, controller", "s", times_.controller_s.value_or(kNever_s), 0, deadline_s);
    if (times_.table_known)
        proof.row("stop, table", "s", times_.table_s.value_or(kNever_s), 0, deadline_s);
    proof.row("stop, platform", "s", times_.platform_s.value_or(kNever_s), 0,
              deadline_s + PadRingDown{}.from_s(level_.level_g));
    keep_ring_down();
    // Out of band: no more of this.
    go_on_to(level_.loop.out_of_band().empty() ? Part::again : Part::rest, now);
    return {};
}

/// The one fault that is made on purpose: the watchdog is not fed.
std::string StopProof::starved(Time now) {
    const auto& settings = level_.settings;
    if (!std::exchange(begun_, true)) {
        level_.ports.log.event(
            Severity::warning,
            fmt::format("proof: the watchdog is not fed now; the table has to stop by itself "
                        "within {:g} s",
                        settings.watchdog_timeout_s + settings.stop.deadline_s));
        times_.begin(now);
    }
    const auto reading = level_.ports.rig.shaker.reading();
    const auto rest = level_.stop.rest(now);
    times_.look(reading, rest);
    auto& proof = level_.proof;
    const double waited_s = to_seconds(now - times_.from());
    const double longest_s = settings.watchdog_timeout_s + level_.stop.longest_s(level_.level_g);
    const bool still = rest.measured_since(times_.from());
    const bool faulty = reading.state == drivers::kShakerFault;
    if (still && faulty) {
        // Fed at most one period before; what stops much earlier was stopped by something else.
        proof.row("watchdog, rest", "s",
                  times_.table_s.value_or(times_.platform_s.value_or(kNever_s)),
                  0.5 * settings.watchdog_timeout_s,
                  times_.table_known ? settings.watchdog_timeout_s + settings.stop.deadline_s
                                     : longest_s);
        proof.row("watchdog, the controller says fault", true);
        go_on_to(Part::clear, now);
        level_.excitation.stop("the proof, to clear the watchdog's fault");
    } else if (waited_s > longest_s) {
        proof.row("watchdog, rest", "s", still ? waited_s : kNever_s, 0, longest_s);
        proof.row("watchdog, the controller says fault", faulty);
        return still
                   ? "the watchdog was not fed, the table stands, but the controller says no fault"
                   : "the watchdog was not fed and the table did not stop: " +
                         level_.stop.what_moves(now);
    }
    return {};
}

std::string StopProof::cleared(Time now) {
    const auto cleared = level_.fault_cleared(now);
    if (!cleared) return {};
    level_.proof.row("watchdog, fault acknowledged", *cleared);
    go_on_to(*cleared && press_wanted_ ? Part::press_ramp : Part::rest, now);
    return {};
}

/// The hard-wired stop. Its opening trips as ever; begin_pressed() finds it here.
std::string StopProof::press(Time /*now*/) {
    auto& log = level_.ports.log;
    if (!std::exchange(begun_, true)) {
        asked_steady_ = log.steady_now();
        log.event(Severity::warning,
                  fmt::format("proof: press the emergency stop{} now, within {:.0f} s",
                              level_.proof.named_button(), to_seconds(kPress)));
    }
    return log.steady_now() - asked_steady_ > kPress ? "nobody pressed the emergency stop" : "";
}

/// The opened chain has tripped, or first the witnesses of the table's fall, between two looks at
/// the chain's register: whether that shows it in time, counted from the fall.
void StopProof::begin_pressed(Time now) {
    level_.take_samples(now);
    pressed_ = Pressed::rest;
    pressed_at_ = now;
    press_felt_ = press_seen_ = false;
    times_.begin(now);
    see_pressed(now);
}

void StopProof::see_pressed(Time now) {
    const auto reading = level_.ports.rig.shaker.reading();
    if (press_seen_ || !reading.valid || !reading.emergency_stop_open) return;
    press_seen_ = true;
    // At 0 g nothing falls: from whichever of the two was seen first, fault or open chain.
    const Time fell = level_.level_g > 0 ? level_.loop.last_at_half() : pressed_at_;
    level_.proof.row("emergency stop, seen", "s", std::max(0.0, to_seconds(now - fell)), 0,
                     level_.settings.proof.seen_s);
}

void StopProof::look(bool tripped, const std::string& reason, Time now) {
    const auto reading = level_.ports.rig.shaker.reading();
    const auto rest = level_.stop.rest(now);
    auto& proof = level_.proof;
    auto& log = level_.ports.log;
    if (pressed_ == Pressed::rest) {
        times_.look(reading, rest);
        see_pressed(now);
        press_felt_ =
            press_felt_ || (reading.valid && reading.time > pressed_at_ &&
                            (reading.fault != 0 || reading.state == drivers::kShakerFault));
        if (level_.stop.stopping() && !level_.stop.disobeyed()) return;
        if (!press_seen_) return end_pressed("not completed: " + reason);
        proof.row("emergency stop, rest", "s", times_.platform_s.value_or(kNever_s), 0,
                  level_.stop.longest_s(level_.level_g));
        if (level_.level_g == 0)
            proof.row("emergency stop, controller", "s", times_.controller_s.value_or(kNever_s), 0,
                      level_.settings.proof.seen_s);
        proof.row("emergency stop, latched", tripped);
        // A contact alone cuts nothing: the trip's own stop brings the table to rest as well.
        proof.row("emergency stop, the controller says fault", press_felt_);
        proof.record().emergency_stop = true;
        pressed_ = Pressed::open;
        asked_steady_ = log.steady_now();
        if (reading.emergency_stop_open)
            log.event(Severity::warning, "proof: close the emergency-stop chain again");
    }
    if (pressed_ == Pressed::open) {
        if (log.steady_now() - asked_steady_ > kPress)
            return end_pressed("nobody closed the emergency-stop chain again");
        if (!reading.valid || reading.emergency_stop_open) return;
        pressed_ = Pressed::closed;
        pressed_at_ = now;
    }
    const bool starts =
        reading.valid && (reading.running || !reading.still() || drivers::is_excited(reading));
    if (starts || rest.moving() || now - pressed_at_ >= kClosed) {
        proof.row("closing the chain starts nothing", !starts && !rest.moving());
        if (starts) level_.excitation.order_stop("the proof: it starts by itself");
        end_pressed({});
    }
}

void StopProof::end_pressed(const std::string& why) {
    pressed_ = Pressed::no;
    conclude(why);
}

std::string StopProof::asks_for() const {
    if (part_ == Part::press && begun_)
        return "press the emergency stop" + level_.proof.named_button() + " now";
    const bool close =
        pressed_ == Pressed::open && level_.ports.rig.shaker.reading().emergency_stop_open;
    return close ? "close the emergency-stop chain again" : "";
}

void StopProof::conclude(const std::string& why) {
    level_.ports.rig.proving(Proving::nothing);
    auto& log = level_.ports.log;
    const auto& record = level_.proof.conclude(log.utc_ns(), why);
    const bool at_zero = record.table_g == 0;
    if (record.passed && !at_zero) level_.stop.pads(record.pads);
    for (const auto& row : record.rows) {
        log.event(row.passed() ? Severity::info : Severity::alarm,
                  fmt::format("proof: {} {:.4g}{}{}, expected {:.4g} to {:.4g}", row.name,
                              row.value, row.unit.empty() ? "" : " ", row.unit, row.low, row.high));
    }
    const std::string what = at_zero ? "the run at 0 g is" : "the safe state is";
    log.event(record.passed ? Severity::info : Severity::alarm,
              record.passed ? what + " proved" : what + " not proved: " + record.message);
    if (const auto trend = level_.proof.trend(); !trend.empty())
        log.event(Severity::warning, "proof: " + trend);
    log.proved(record);
}

}  // namespace vibrig::campaign
