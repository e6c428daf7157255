// The loop check and the safe-state proof: about a minute at a small level, its own arming.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/stages/stage.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {
constexpr Time kCheckPoll = 200 * drivers::kMillisecond;
constexpr Time kLook = 2 * kSecond;  // at rest, before
// How late samples may be.
constexpr Time kCheckSilence = kSecond;
// Peak at the table: a tenth of a g is beyond doubt only after a thirtieth.
constexpr std::array kLadder_g{0.03, 0.1, 0.3};
constexpr Time kRung = 5 * kSecond;    // how long each counts
constexpr double kLadderUnit = 1.122;  // 1 dB: the table's own accelerometer is good to 2 %
}  // namespace

void Campaign::take_over_loop_check(const std::string& out_of_band) {
    loop_->take_over(out_of_band);
}

std::string Campaign::not_fit_to_check(Time now) const {
    if (active()) return "a campaign is running";
    if (state_ == State::checking) return "a loop check is running";
    if (state_ == State::commissioning) return "the rig is being commissioned by " + reason_;
    if (state_ == State::tripped) return "tripped (" + reason_ + "): acknowledge it first";
    if (state_ == State::armed) return "armed for a campaign: abort that first";
    if (ports_.rig.feed == nullptr) return "no samples to look at";
    if (auto why = not_fit_to_excite(now); !why.empty()) return why;
    if (auto why = platform_lacks(ports_.rig.platform(), now); !why.empty()) return why;
    if (torquing(ports_.rig)) return "the platform is torqued, expected free drift";
    return LoopCheck::beyond_limits(settings_);
}

CommandReply Campaign::begin_loop_check(const CommandRequest& request, Time now) {
    constexpr std::string_view kPress = "emergency_stop";
    const bool press = request.argument.starts_with(kPress);
    std::string button;
    if (press && request.argument.size() > kPress.size() + 1)
        button = request.argument.substr(kPress.size() + 1);
    const auto& buttons = settings_.proof.buttons;
    if (!press && !request.argument.empty())
        return {false,
                "selftest: found \"" + request.argument + "\", expected nothing or emergency_stop"};
    if (!button.empty() && std::ranges::find(buttons, button) == buttons.end())
        return {false, "selftest: found the button \"" + button +
                           "\", expected one of commission.buttons"};
    if (auto why = not_fit_to_check(now); !why.empty()) return {false, why};
    armed_by_ = request.by;
    armed_for_ = arming_text(request);
    armed_under_ = ports_.rig.shaker.stops();
    reason_.clear();
    loop_->begin(request.by);
    proof_.begin(request.by, settings_.loop.table_g);
    rungs_.clear();
    rung_ = 0;
    for (const double rung_g : kLadder_g)
        if (climbs_ && rung_g < settings_.loop.table_g) rungs_.push_back(rung_g);
    press_wanted_ = press;
    // There is but one.
    proof_.record().button = press && button.empty() && buttons.size() == 1 ? buttons[0] : button;
    pressed_ = Pressed::no;
    ports_.rig.feed->order(rt::StageFeed::Mode::samples);
    last_motion_ = now;
    check_ = Check::look;
    enter(State::checking, now);
    const std::string text =
        fmt::format("loop check and safe-state proof at {:g} g", settings_.loop.table_g);
    ports_.log.event(Severity::info, fmt::format("{} by {}", text, request.by));
    return {true, text};
}

bool Campaign::take_motion(rt::Motion& motion, Time now) {
    if (!ports_.rig.feed->pop(motion)) return false;
    last_motion_ = now;
    return true;
}

/// The next part of the check; the ramps have their time from here on.
void Campaign::go_on_to(Check part, Time now) {
    check_ = part;
    entered_ = now;
    requested_ = stop_sent_ = rung_counts_ = false;
    const bool steady = part == Check::settle || part == Check::measure || part == Check::press;
    proving(part == Check::stop || part == Check::clear ? Proving::stop
            : part == Check::watchdog                   ? Proving::watchdog
                                                        : Proving::nothing);
    ports_.rig.commanded(steady ? settings_.loop.table_g : 0, excited_deg_);
    ports_.rig.guard(rt::Guard::excitation);
}

Time Campaign::check_loop(Time now) {
    rt::Motion motion;
    while (take_motion(motion, now)) loop_->add(motion);
    const Time since = now - entered_;
    const auto reading = ports_.rig.shaker.reading();
    if (now - last_motion_ > kCheckSilence) {
        abort("samples ceased", now);
    } else if (auto why = platform_lacks(ports_.rig.platform(), now); !why.empty()) {
        abort(why, now);
    } else if ((check_ == Check::settle || check_ == Check::measure || check_ == Check::press) &&
               !reading.emergency_stop_open &&
               !vibrating_as_commanded(reading, settings_.loop.table_g) &&
               !stopped_by_another(now)) {
        abort(fmt::format("shaker off command: state {}, measured {:.3f} g, expected {:g} g",
                          reading.state, reading.measured_g, settings_.loop.table_g),
              now);
    } else if (check_ == Check::look && since >= kLook) {
        if (const auto still = loop_->look(excited_deg_); !still.empty()) {
            abort(still, now);
        } else if (!stop_.rest(now).measured()) {
            abort("not at rest: " + stop_.what_moves(now), now);
        } else if (prove_quiet(); proof_.record().rows.back().passed()) {
            go_on_to(rungs_.empty() ? Check::ramp : Check::climb, now);
        } else {
            abort("the noise at rest is too near to shaker.rest_g", now);
        }
    } else if (check_ == Check::climb) {
        ramp_for_check(Check::rung, now);
    } else if (check_ == Check::rung) {
        stand_on_rung(now);
    } else if (check_ == Check::ramp) {
        ramp_for_check(Check::settle, now);
    } else if (check_ == Check::again) {
        ramp_for_check(Check::watchdog, now);
    } else if (check_ == Check::press_ramp) {
        ramp_for_check(Check::press, now);
    } else if (check_ == Check::settle && since >= from_seconds(settings_.settle_s)) {
        loop_->measure();
        go_on_to(Check::measure, now);
        prove_refusals(now);
    } else if (check_ == Check::measure && since >= from_seconds(settings_.loop.measure_s)) {
        loop_->finish(reading.measured_g);
        ports_.log.loop_checked(armed_by_, loop_->out_of_band());
        if (loop_->out_of_band().empty()) {
            proof_.record().transmission = loop_->transmission();
            ports_.rig.transmission(loop_->transmission());
        }
        proof_.row("loop check in band", loop_->out_of_band().empty());
        for (const auto& row : loop_->status().rows) {  // the ratios
            if (std::isfinite(row.value) && std::isfinite(row.low) && std::isfinite(row.high))
                proof_.row(row.name, row.unit, row.value, row.low, row.high);
        }
        order_proved_stop(now);
    } else if (check_ == Check::stop) {
        prove_stop(now);
    } else if (check_ == Check::watchdog) {
        prove_watchdog(now);
    } else if (check_ == Check::clear) {
        prove_clearing(now);
    } else if (check_ == Check::press) {
        prove_emergency_stop(now);
    } else if (check_ == Check::rest && come_to_rest(now)) {
        conclude_loop_check(now);
    }
    return now + kCheckPoll;
}

/// Where the table is to be.
double Campaign::check_level() const {
    return check_ == Check::climb || check_ == Check::rung ? rungs_[rung_] : settings_.loop.table_g;
}

Campaign::Check Campaign::after_rung() const {
    return rung_ < rungs_.size() ? Check::climb : Check::ramp;
}

/// One step of the ladder: what table and platform do is held against the command before more is
/// asked for. A wrong unit shows itself here, while the worst confusion makes 0.42 g of 0.03.
void Campaign::stand_on_rung(Time now) {
    const double rung_g = check_level();
    const Time since = now - entered_, settled = from_seconds(settings_.settle_s);
    if (const auto reading = ports_.rig.shaker.reading();
        !vibrating_as_commanded(reading, rung_g) && !stopped_by_another(now))
        return abort(fmt::format("ladder: shaker off command: state {}, measured {:.3f} g, "
                                 "expected {:g} g",
                                 reading.state, reading.measured_g, rung_g),
                     now);
    if (since >= settled && !std::exchange(rung_counts_, true)) loop_->measure();
    if (since < settled + kRung) return;
    const auto peak = loop_->peak();
    const double platform = peak.platform_g / (settings_.rig.transmission * rung_g);
    const double table = peak.table_g / rung_g;
    const bool table_known = loop_->noise().table_g > 0;  // zero where it has none
    const std::string at = fmt::format("ladder, {:g} g, ", rung_g);
    proof_.row(at + "platform over expected", "", platform, 0.5, 2);
    bool passed = proof_.record().rows.back().passed();
    if (table_known) {
        proof_.row(at + "table over command", "", table, 1 / kLadderUnit, kLadderUnit);
        passed = passed && proof_.record().rows.back().passed();
    }
    if (!passed) {
        const auto unit = unit_of_ratio(table_known ? table : platform);
        return abort(fmt::format("ladder: at {:g} g the platform does {:.3g} times, the table {} "
                                 "what was expected{}{}",
                                 rung_g, platform,
                                 table_known ? fmt::format("{:.3g} times", table) : "unseen",
                                 unit.empty() ? "" : ": ", unit),
                     now);
    }
    ++rung_;
    go_on_to(after_rung(), now);
}

/// Up to the level, then on to `then`.
void Campaign::ramp_for_check(Check then, Time now) {
    const double level_g = check_level();
    if (!requested_) {
        requested_ = ask_level(level_g, now);
        if (!requested_) abort("the shaker takes no set-point", now);
    } else if (!ports_.rig.shaker.busy() &&
               vibrating_as_commanded(ports_.rig.shaker.reading(), level_g)) {
        go_on_to(then, now);
    } else if (now - entered_ > from_seconds(settings_.ramp_s) + kRampGrace) {
        abort(fmt::format("shaker: measured {:.3f} g, expected {:g} g",
                          ports_.rig.shaker.reading().measured_g, level_g),
              now);
    }
}

void Campaign::conclude_loop_check(Time now) {
    leave_stage();
    loop_->conclude();
    conclude_proof({});
    armed_by_.clear();
    enter(State::idle, now);
    const auto& found = loop_->status();
    for (const auto& row : found.rows) {
        ports_.log.event(
            Severity::info,
            fmt::format("loop check: {} {:.4g}{}{}, band {:.4g} to {:.4g}", row.name, row.value,
                        *row.unit == '\0' ? "" : " ", row.unit, row.low, row.high));
    }
    if (found.message.empty()) {
        ports_.log.event(Severity::info, "loop check in band");
    } else {
        ports_.log.event(Severity::alarm,
                         "loop check out of band, no campaign is armed: " + found.message);
    }
}

}  // namespace vibrig::campaign
