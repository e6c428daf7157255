// The opening check: before the first ramp of a campaign, or alone, with nothing armed.
#include <spdlog/fmt/fmt.h>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "daemon/campaign/stages/zeroing.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;
using Came = StageStep::Kind;

bool Campaign::opening() const { return stage_ != nullptr && stage_ == opening_.get(); }

bool Campaign::opens_alone() const { return opening() && state_ == State::checking; }

std::string Campaign::check_under_way() const {
    return opening() ? "an opening check is running" : "a loop check is running";
}

void Campaign::begin_opening(Time now) {
    ports_.log.event(Severity::info, "opening check: free drift and gravity at rest");
    begin(*opening_, State::waiting, now);
}

std::string Campaign::not_fit_to_move(Time now) const {
    if (active()) return "a campaign is running";
    if (state_ == State::checking) return check_under_way();
    if (state_ == State::commissioning) return "the rig is being commissioned by " + reason_;
    if (state_ == State::tripped) return "tripped (" + reason_ + "): acknowledge it first";
    if (state_ == State::armed) return "armed for a campaign: abort that first";
    if (auto why = ports_.rig.unfit(); !why.empty()) return why;
    if (auto why = not_at_rest(now); !why.empty()) return why;
    if (auto why = platform_lacks(ports_.rig.platform(), now); !why.empty()) return why;
    if (torquing(ports_.rig)) return "the platform is torqued, expected free drift";
    return {};
}

std::string Campaign::not_fit_to_open(Time now) const {
    if (!opening_)
        return "opening check: no position is within gimbal.travel_deg, or nobody measures angles "
               "and force";
    return not_fit_to_move(now);
}

CommandReply Campaign::begin_rest_check(const CommandRequest& request, Time now) {
    if (auto why = not_fit_to_open(now); !why.empty()) return {false, why};
    reason_.clear();
    rest_check_ = {"running", request.by, 0, {}, {}};
    ports_.rig.gimbal.forget_position();
    begin(*opening_, State::checking, now);
    const auto text =
        fmt::format("opening check, about {:.0f} min", opening_->check().expected_s() / 60);
    ports_.log.event(Severity::info, fmt::format("{} by {}", text, request.by));
    return {true, text};
}

Time Campaign::open(Time now) {
    if (!ports_.rig.shaker.reading().at_rest()) {
        abort("opening check: the shaker left rest", now);
        return now;
    }
    reason_ = opening_->check().words();
    const StageStep step = opening_->step(now);
    if (step.kind == Came::going_on) return step.next;
    if (step.kind == Came::failed) {
        abort("opening check: " + step.why, now);
    } else {
        conclude_opening(now);
    }
    return now;
}

void Campaign::conclude_opening(Time now) {
    Vector zero_g{};
    if (zeros() != nullptr && zeros()->status().known) zero_g = zeros()->raw_zero_g();
    const auto verdict = opening_->check().judge(zero_g);
    const bool alone = opens_alone();
    leave_stage();
    if (!verdict.warned.empty())
        ports_.log.event(Severity::alarm, "opening check: " + verdict.warned);
    const auto refused = verdict.refused + "; " + verdict.suspects_text();
    if (verdict.refused.empty())
        ports_.log.event(Severity::info, "opening check: the rig is what its configuration says");
    if (alone) {
        if (!verdict.refused.empty())
            ports_.log.event(Severity::alarm, "opening check: " + refused);
        const auto more = verdict.warned +
                          (verdict.warned.empty() || verdict.apart.empty() ? "" : "; ") +
                          verdict.apart;
        return conclude_rest_check(verdict.refused, more, verdict.suspects, now);
    }
    opened_ = true;
    if (!verdict.refused.empty()) {
        ports_.rig.gimbal.release(now);
        return abort("opening check: " + refused, now);
    }
    start_position(now);
}

void Campaign::conclude_rest_check(const std::string& refused, const std::string& warned,
                                   const std::vector<std::string>& suspects, Time now) {
    rest_check_.verdict = !refused.empty() ? "refused" : !warned.empty() ? "told" : "right";
    rest_check_.message = refused + (refused.empty() || warned.empty() ? "" : "; ") + warned;
    rest_check_.suspects = suspects;
    rest_check_.utc_ns = utc_ns();
    reason_.clear();
    enter(State::idle, now);
    ports_.rig.gimbal.release(now);
}

}  // namespace vibrig::campaign
