#include "daemon/campaign/stages/zero_run.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;
using drivers::to_seconds;

namespace {
constexpr Time kRuns = 5 * kSecond;  // the first time
constexpr double kFed = 5;           // timeouts that a watchdog which is fed has to bear
constexpr Time kClosedAfter = kSecond;
constexpr double kLate_s = 0.5;  // after its timeout a starved watchdog has stopped
// The link is made again so much before that, to see it in time.
constexpr double kLinkAgain_s = 0.2;
constexpr Time kLinkPatience = 10 * kSecond;
constexpr Time kStays = 3 * kSecond;
constexpr double kOffGravity_g = 0.005;

/// By its own word; the run register may stay as it was in a fault.
bool says_stopped(const drivers::ShakerReading& reading) {
    return reading.state == drivers::kShakerIdle || reading.state == drivers::kShakerFault;
}

}  // namespace

void ZeroRun::begin(Time now) {
    level_.begin(by_, 0, now);
    round_ = Round::ordered;
    part_ = Part::look;
}

void ZeroRun::go_on_to(Part part, Time now) {
    part_ = part;
    const bool starves = part == Part::ends || part == Part::stays;
    level_.begin_part(false,
                      hung_up()                                   ? Proving::unlinked
                      : starves && round_ != Round::ordered       ? Proving::watchdog
                      : part == Part::ends || part == Part::clear ? Proving::stop
                                                                  : Proving::nothing,
                      now);
}

StageStep ZeroRun::step(Time now) {
    std::string why = level_.lacks(now);
    if (!why.empty()) return StageStep::failed(std::move(why));
    switch (part_) {
        case Part::none:
            break;
        case Part::look:
            why = look(now);
            break;
        case Part::start:
            why = start(now);
            break;
        case Part::runs:
            why = run(now);
            break;
        case Part::ends:
            why = round_ == Round::ordered ? stopped(now) : starved(now);
            break;
        case Part::stays:
            why = stay(now);
            break;
        case Part::clear:
            why = cleared(now);
            break;
        case Part::rest:
            return level_.come_to_rest(now);
    }
    return why.empty() ? StageStep::going_on(now + kStagePoll) : StageStep::failed(std::move(why));
}

std::string ZeroRun::look(Time now) {
    if (now - level_.excitation.since() < kLook) return {};
    auto why = level_.look_at_rest(now);
    if (!why.empty()) return why;
    level_.proof.row("at 0 g, state before", "", level_.ports.rig.shaker.reading().state, 0, 0);
    go_on_to(Part::start, now);
    return unless_passed("the controller is not idle before it runs");
}

std::string ZeroRun::start(Time now) {
    bool reached = false;
    auto why = level_.excitation.climb(0, now, reached);
    if (!why.empty() || !reached) return why;
    level_.loop.measure();
    measured_g_ = 0;
    go_on_to(Part::runs, now);
    return {};
}

Time ZeroRun::length() const {
    if (round_ == Round::ordered) return kRuns;
    return round_ == Round::starved ? from_seconds(kFed * level_.settings.watchdog_timeout_s)
                                    : kClosedAfter;
}

/// A trip meanwhile, by a watchdog that fires although it is fed, ends it all.
std::string ZeroRun::run(Time now) {
    if (auto why = level_.off_command(now); !why.empty()) return why;
    const auto reading = level_.ports.rig.shaker.reading();
    if (reading.valid) measured_g_ = std::max(measured_g_, std::abs(reading.measured_g));
    if (now - level_.excitation.since() < length()) return {};
    if (round_ == Round::ordered) {
        if (auto why = judge_run(); !why.empty()) return why;
    } else if (round_ == Round::starved) {
        level_.proof.row("watchdog at 0 g, fed", "s", to_seconds(length()), to_seconds(length()),
                         to_seconds(length()));
    }
    go_on_to(Part::ends, now);
    times_.begin(now);
    const double timeout_s = level_.settings.watchdog_timeout_s;
    if (round_ == Round::ordered) {
        level_.excitation.stop("the run at 0 g");
        return {};
    }
    const bool closed = round_ == Round::closed;
    if (closed)
        level_.ports.rig.shaker.hang_up_until(now +
                                              from_seconds(timeout_s + kLate_s - kLinkAgain_s));
    level_.ports.log.event(
        Severity::warning,
        fmt::format("proof: at 0 g the watchdog is not fed now{}; the controller has to stop by "
                    "itself within {:g} s",
                    closed ? ", and the link is closed" : "", timeout_s + kLate_s));
    return {};
}

/// Neither platform nor table may have felt it.
std::string ZeroRun::judge_run() {
    const auto& loop = level_.loop;
    auto& proof = level_.proof;
    const auto peak = loop.peak();
    proof.row("at 0 g, ramping or running seen", true);  // or it would not have come here
    proof.row("at 0 g, platform off 1 g", "g", std::abs(loop.mean_force_g() - 1) + peak.platform_g,
              0, kOffGravity_g);
    std::string why = unless_passed("the platform feels that the controller runs at 0 g");
    if (loop.noise().table_g > 0) {
        proof.row("at 0 g, table", "g", peak.table_g, 0, Excitation::kAtZero_g);
        if (why.empty()) why = unless_passed("the table moves although 0 g is commanded");
    }
    proof.row("at 0 g, measured by the controller", "g", measured_g_, 0, Excitation::kAtZero_g);
    return why.empty() ? unless_passed("the controller measures more than 0 g") : why;
}

std::string ZeroRun::stopped(Time now) {
    const auto& stop = level_.stop;
    const auto reading = level_.ports.rig.shaker.reading();
    times_.look(reading, stop.rest(now));
    if (stop.disobeyed()) return "a stop was not obeyed in its time";
    const double deadline_s = level_.settings.stop.deadline_s;
    const bool may_be_stopping = now - times_.from() <= from_seconds(deadline_s);
    if (stop.stopping() || (reading.state != drivers::kShakerIdle && may_be_stopping)) return {};
    level_.proof.row("at 0 g, stop", "s", times_.controller_s.value_or(kNever_s), 0, deadline_s);
    level_.proof.row("at 0 g, state after", "", reading.state, 0, 0);
    if (auto why = unless_passed("the controller is not idle after it ran"); !why.empty())
        return why;
    if (!brief_) round_ = Round::starved;
    go_on_to(brief_ ? Part::rest : Part::start, now);
    return {};
}

std::string ZeroRun::starved(Time now) {
    const double timeout_s = level_.settings.watchdog_timeout_s;
    const bool closed = round_ == Round::closed;
    const auto reading = level_.ports.rig.shaker.reading();
    // Of a link that is made again, what it says first; else when it first says so.
    const Time counts_from = times_.from() + (closed ? from_seconds(timeout_s) : 0);
    const bool seen = reading.valid && reading.time > counts_from;
    const bool stands = seen && says_stopped(reading);
    const Time waited = now - times_.from();
    const Time longest = from_seconds(timeout_s + kLate_s);
    if (!stands && !(closed && seen) && waited <= longest + (closed ? kLinkPatience : kSecond))
        return {};
    // Fed at most one period before; what stops much earlier was stopped by something else.
    level_.proof.row(closed ? "watchdog at 0 g, link closed" : "watchdog at 0 g, not fed", "s",
                     stands ? to_seconds(reading.time - times_.from()) : kNever_s,
                     closed ? 0 : 0.5 * timeout_s, timeout_s + kLate_s);
    const std::string what =
        closed ? "with its link closed the watchdog" : "the watchdog was not fed, and";
    if (closed && !seen) return "the link to the controller was not made again";
    if (auto why =
            unless_passed(fmt::format("{} did not stop the controller within {:g} s: state {}",
                                      what, timeout_s + kLate_s, reading.state));
        !why.empty())
        return why;
    go_on_to(Part::stays, now);
    return {};
}

std::string ZeroRun::stay(Time now) {
    const auto reading = level_.ports.rig.shaker.reading();
    const bool starts = reading.valid && !says_stopped(reading);
    if (!starts && now - level_.excitation.since() < kStays) return {};
    level_.proof.row(round_ == Round::closed ? "watchdog at 0 g, link closed, stays stopped"
                                             : "watchdog at 0 g, stays stopped",
                     !starts);
    if (auto why = unless_passed("the watchdog stopped the controller, and it runs again");
        !why.empty())
        return why;
    go_on_to(Part::clear, now);
    level_.excitation.stop("the run at 0 g, to clear the watchdog's fault");
    return {};
}

std::string ZeroRun::cleared(Time now) {
    const auto cleared = level_.fault_cleared(now);
    if (!cleared) return {};
    level_.proof.row("watchdog at 0 g, fault acknowledged", *cleared);
    if (auto why = unless_passed("the watchdog's fault is not acknowledged by a stop");
        !why.empty())
        return why;
    const bool more = round_ == Round::starved;
    round_ = Round::closed;
    go_on_to(more ? Part::start : Part::rest, now);
    return {};
}

std::string ZeroRun::unless_passed(const std::string& why) const {
    return level_.proof.record().rows.back().passed() ? "" : why;
}

std::string ZeroRun::where() const {
    if (part_ == Part::none) return {};
    if (part_ == Part::runs && round_ == Round::starved)
        return "; at 0 g, while its watchdog was fed";
    return "; at 0 g";
}

}  // namespace vibrig::campaign
