// What the campaign makes of loop check and safe-state proof: about a minute at a small level, its
// own arming.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/stages/loop_checking.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "daemon/campaign/stages/stop_proof.hpp"
#include "daemon/campaign/stages/zero_run.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;
using Came = StageStep::Kind;

namespace {
/// Of a self-test's argument: the run at 0 g.
constexpr std::string_view kAtZero = "at_zero";
}  // namespace

void Campaign::take_over_loop_check(const std::string& out_of_band) {
    loop_->take_over(out_of_band);
}

void Campaign::take_over_proofs(std::vector<ProofRecord> history) {
    proof_.take_over(std::move(history));
    stop_.pads(proof_.pads());
    // The witnesses go on with what was measured; a key that has changed since asks for a new one.
    for (const auto& [hz, ratio] : proof_.transmissions()) excitation_.measured(hz, ratio);
    const auto transmission = proof_.transmission();
    if (!transmission) return;
    ports_.rig.transmission(*transmission);
    excitation_.measured(settings_.frequency_hz, *transmission);
    if (proof_.in_step().empty())
        ports_.log.event(Severity::info,
                         "the newest proof is of a time when no motion in step was measured: its "
                         "growth is not watched before the next one");
    ports_.log.event(Severity::info,
                     fmt::format("transmission {:.4g}, as the loop check of the newest "
                                 "proof measured it",
                                 *transmission));
}

std::string Campaign::not_fit_to_check(Time now) const {
    if (auto why = not_fit_to_move(now); !why.empty()) return why;
    if (auto why = not_fit_to_excite(now); !why.empty()) return why;
    if (ports_.rig.feed == nullptr) return "no samples to look at";
    return LoopCheck::beyond_limits(settings_);
}

CommandReply Campaign::begin_check(const CommandRequest& request, Time now) {
    constexpr std::string_view kPress = "emergency_stop";
    if (request.argument == kRestCheck) return begin_rest_check(request, now);
    std::string_view asked = request.argument;
    const bool at_zero = asked.starts_with(kAtZero);
    if (at_zero) asked.remove_prefix(std::min(asked.size(), kAtZero.size() + 1));
    const bool press = asked.starts_with(kPress);
    const std::string button(press ? asked.substr(std::min(asked.size(), kPress.size() + 1))
                                   : std::string_view());
    const auto& buttons = settings_.proof.buttons;
    if (!press && !asked.empty())
        return {false, "selftest: found \"" + request.argument +
                           "\", expected nothing, rest, emergency_stop, at_zero or both"};
    if (!button.empty() && std::ranges::find(buttons, button) == buttons.end())
        return {false, "selftest: found the button \"" + button +
                           "\", expected one of commission.buttons"};
    if (auto why = not_fit_to_check(now); !why.empty()) return {false, why};
    if (climbs_ && !at_zero)
        if (auto why = proof_.lacks_at_zero(); !why.empty()) return {false, why};
    armed_by_ = request.by;
    armed_for_ = arming_text(request);
    excitation_.armed();
    reason_.clear();
    checking_->aim(request.by, climbs_);
    zero_run_->aim(request.by, press);
    proving_->with_press(press);
    if (at_zero)
        begin(*zero_run_, State::checking, now);
    else
        begin(*checking_, State::checking, now);
    // There is but one.
    proof_.record().button = press && button.empty() && buttons.size() == 1 ? buttons[0] : button;
    const std::string text =
        at_zero ? fmt::format("run at 0 g{}", press ? ", and the emergency stop" : "")
                : fmt::format("loop check and safe-state proof at {:g} g", settings_.loop.table_g);
    ports_.log.event(Severity::info, fmt::format("{} by {}", text, request.by));
    return {true, text};
}

Time Campaign::check(Time now) {
    if (opening()) return open(now);
    const StageStep step = stage_->step(now);
    switch (step.kind) {
        case Came::going_on:
            return step.next;
        case Came::asks:
            prove_refusals(now);
            break;
        case Came::failed:
            abort(step.why, now);
            break;
        case Came::done:
            if (stage_ == proving_.get() || (checks_at_zero() && !proving_->wants_press())) {
                conclude_check(now);
            } else if (std::exchange(stage_, proving_.get()) == zero_run_.get()) {
                zero_run_->leave();
                proving_->begin_at_zero(now);
            } else {
                stage_->begin(now);
            }
    }
    return now + kStagePoll;
}

/// Every order that must not be followed while the table moves, tried.
void Campaign::prove_refusals(Time now) {
    const auto tried = command({CommandRequest::Kind::arm, proof_.record().by, ""}, now);
    proof_.row("arming is refused while it moves", !tried.accepted);
    proof_.row("a slew is refused while it moves", !may_slew(ports_.rig, stop_).empty());
    proof_.row("another frequency is refused while it moves",
               excitation_.refuses_frequency(settings_.frequency_hz + 1, settings_.loop.table_g));
}

bool Campaign::checks_at_zero() const { return small_level_->level_g == 0; }

/// It ends before it is done, in this state.
void Campaign::end_check(State state, const std::string& why, Time now) {
    if (opening()) {
        rest_check_.verdict = "not completed";
        rest_check_.message = why;
        rest_check_.utc_ns = utc_ns();
        return;
    }
    if (!checks_at_zero()) loop_->not_completed(why);
    if (proving_->waits_for_press() &&
        (state == State::tripped || ports_.rig.shaker.reading().emergency_stop_open)) {
        proving_->begin_pressed(now);
    } else {
        proving_->conclude("not completed: " + why + checking_->suspect_unit() +
                           zero_run_->where());
    }
}

void Campaign::conclude_check(Time now) {
    leave_stage();
    const bool at_zero = checks_at_zero();
    if (!at_zero) loop_->conclude();
    proving_->conclude({});
    armed_by_.clear();
    enter(State::idle, now);
    if (at_zero) return;
    const auto& found = loop_->status();
    for (const auto& row : found.rows) {
        ports_.log.event(
            Severity::info,
            fmt::format("loop check: {} {:.4g}{}{}, band {:.4g} to {:.4g}", row.name, row.value,
                        row.unit.empty() ? "" : " ", row.unit, row.low, row.high));
    }
    if (found.message.empty()) {
        ports_.log.event(Severity::info, "loop check in band");
    } else {
        ports_.log.event(Severity::alarm,
                         "loop check out of band, no campaign is armed: " + found.message);
    }
}

}  // namespace vibrig::campaign
