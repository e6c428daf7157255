// The opening check within a campaign: gimbals slew and drift, the table rests.
#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/opening_stage.hpp"
#include "daemon/campaign/zeroing_stage.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;

namespace {
constexpr Time kOpeningPoll = 200 * drivers::kMillisecond;
}  // namespace

void Campaign::make_opening() {
    if (settings_.opening.empty() || !ports_.rig.second()) return;
    opening_ = std::make_shared<OpeningStage>(settings_);
    times_.opening_s = opening_->expected_s();
}

bool Campaign::opening() const { return opening_ && opening_->under_way(); }

void Campaign::begin_opening(Time now) {
    opening_->begin();
    part_ = Part::go;
    ports_.log.event(Severity::info, "opening check: free drift and gravity at rest");
    enter(State::waiting, now);
}

Time Campaign::open(Time now) {
    const auto fail = [&](const std::string& why) {
        abort("opening check: " + why, now);
        return now;
    };
    if (!ports_.rig.shaker.reading().at_rest()) return fail("the shaker left rest");
    reason_ = opening_->words();
    if (part_ == Part::go) {
        if (const auto why = may_slew(); !why.empty()) return fail(why);
        ports_.rig.gimbal.slew_to(opening_->target_deg(), now);
        part_ = Part::slew;
    }
    const auto gimbal = ports_.rig.gimbal.update(ports_.rig.platform(), now);
    if (gimbal == drivers::GimbalState::timed_out || gimbal == drivers::GimbalState::no_status)
        return fail(fmt::format("gimbals: {}", drivers::name_of(gimbal)));
    if (part_ == Part::slew && gimbal == drivers::GimbalState::in_position) {
        if (opening_->drifts()) ports_.rig.gimbal.release(now);
        part_ = Part::release;
    }
    if (part_ == Part::release) {
        // Let go is what says so itself.
        if (opening_->drifts() && ports_.rig.gimbal.state() == drivers::GimbalState::commanding)
            return std::min(ports_.rig.gimbal.next_deadline(), now + kOpeningPoll);
        opening_->arrived(now);
        part_ = Part::measure;
    } else if (part_ == Part::measure) {
        // While it slews a platform may say that it is not ready.
        if (const auto why = platform_lacks(now); !why.empty()) return fail(why);
        opening_->add(ports_.rig.second().value_or(rt::MeanMotion{}));
        if (opening_->measured()) {
            part_ = Part::go;
            if (!opening_->next()) conclude_opening(now);
            return now;
        }
        if (opening_->overdue(now))
            return fail("no still seconds: force or angles are missing or move");
    }
    return std::min(ports_.rig.gimbal.next_deadline(), now + kOpeningPoll);
}

void Campaign::conclude_opening(Time now) {
    Vector zero_g{};
    if (zero_ && zero_->status().known) zero_g = zero_->raw_zero_g();
    const auto verdict = opening_->judge(zero_g);
    opening_->end();
    opened_ = true;
    if (!verdict.told.empty()) ports_.log.event(Severity::alarm, "opening check: " + verdict.told);
    if (!verdict.refused.empty()) {
        ports_.rig.gimbal.release(now);
        return abort("opening check: " + verdict.refused + "; " + verdict.suspects, now);
    }
    ports_.log.event(Severity::info, "opening check: the rig is what its configuration says");
    start_position(now);
}

}  // namespace vibrig::campaign
