// The campaign's stages, and what it makes of those with the table at rest: which begins, what
// follows.
#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/gravity_watch.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/stages/dwelling.hpp"
#include "daemon/campaign/stages/levelling.hpp"
#include "daemon/campaign/stages/loop_checking.hpp"
#include "daemon/campaign/stages/opening.hpp"
#include "daemon/campaign/stages/stop_proof.hpp"
#include "daemon/campaign/stages/waiting.hpp"
#include "daemon/campaign/stages/zero_run.hpp"
#include "daemon/campaign/stages/zeroing.hpp"

namespace vibrig::campaign {

using drivers::kSecond;
using drivers::Time;
using State = CampaignState;
using Came = StageStep::Kind;

void Campaign::make_stages() {
    times_ = stage_times(settings_);
    gravity_ = std::make_shared<GravityWatch>(
        settings_.rig, GravityLimits{.refused_deg = settings_.gravity_refused_deg});
    loop_ = std::make_shared<LoopCheck>(settings_.loop, settings_.rig);
    small_level_ =
        std::make_shared<SmallLevel>(settings_, ports_, excitation_, stop_, *loop_, proof_);
    zero_run_ = std::make_shared<ZeroRun>(*small_level_);
    checking_ = std::make_shared<LoopChecking>(*small_level_);
    proving_ = std::make_shared<StopProof>(*small_level_);
    dwelling_ = std::make_shared<Dwelling>(settings_, ports_, excitation_, stop_);
    waiting_ = std::make_shared<Waiting>(settings_, ports_.rig);
    if (settings_.levelling && ports_.rig.torquer != nullptr && ports_.rig.feed != nullptr)
        level_ = std::make_shared<Levelling>(settings_, ports_);
    if (settings_.zeroing && ports_.rig.feed != nullptr)
        zero_ = std::make_shared<Zeroing>(settings_, ports_.rig, ports_.log, level_ != nullptr);
    if (!settings_.opening.empty() && ports_.rig.second()) {
        opening_ = std::make_shared<Opening>(settings_, ports_.rig, stop_);
        if (settings_.open_first) times_.opening_s = opening_->check().expected_s();
    }
}

void Campaign::begin(Stage& stage, State state, Time now) {
    stage_ = &stage;
    stage.begin(now);
    enter(state, now);
}

/// Whatever was under way, nothing is fed or torqued any more.
void Campaign::leave_stage() {
    if (stage_ != nullptr) std::exchange(stage_, nullptr)->leave();
    let_go(ports_.rig);
}

void Campaign::insist_on_zero_torque(Time now) {
    // Levelling torques by itself, and so does what is commissioned.
    if (ports_.rig.torquer == nullptr || state_ == State::levelling || commissioning()) return;
    const bool ours = active() || state_ == State::tripped || torque_left_;
    if (ports_.rig.torquer->zero() && !(ours && torquing(ports_.rig))) return;
    if (now - torque_sent_ < kStagePoll) return;
    torque_sent_ = now;
    static_cast<void>(ports_.rig.torquer->command({}));
}

Time Campaign::wait_for_platform(Time now) {
    const StageStep step = waiting_->step(now);
    reason_ = waiting_->words();
    if (step.kind == Came::going_on) return step.next;
    if (step.kind == Came::failed) {
        abort(step.why, now);
    } else {
        stage_ = nullptr;
        start_position(now);
    }
    return now;
}

const ZeroCalibration* Campaign::zeros() const { return zero_ ? &zero_->calibration() : nullptr; }

void Campaign::begin_zeroing(bool at_end, Time now) {
    zeroing_ = at_end ? ZeroingAt::end : ZeroingAt::start;
    zero_->at_end(at_end);
    ports_.log.event(Severity::info,
                     at_end ? "accelerometer zeros again" : "accelerometer zeros by azimuth slews");
    begin(*zero_, State::zeroing, now);
}

Time Campaign::zeroing(Time now) {
    if (!ports_.rig.shaker.reading().at_rest()) {
        abort("the shaker left rest while the accelerometer zeros were taken", now);
        return now;
    }
    const StageStep step = zero_->step(now);
    switch (step.kind) {
        case Came::going_on:
            return step.next;
        case Came::asks:
            begin_levelling(now);
            break;
        case Came::failed:
            fail_zeroing(step.why, now);
            break;
        case Came::done:
            stage_ = nullptr;
            if (zeroing_ == ZeroingAt::end) {
                mark_ = zeros()->status().mark;
                leave_zeroing(now);
            } else {
                zeroing_ = ZeroingAt::none;
                zeroed_ = true;
                start_position(now);
            }
    }
    return now;
}

void Campaign::fail_zeroing(const std::string& why, Time now) {
    if (zeroing_ != ZeroingAt::end) return abort("zeroing: " + why, now);
    // The dwells are done: the campaign stands, but nobody can say that the zeros stayed.
    mark_ = "zeros not confirmed at the end: " + why;
    leave_zeroing(now);
}

void Campaign::leave_zeroing(Time now) {
    zeroing_ = ZeroingAt::none;
    leave_stage();
    ports_.rig.gimbal.release(now);
    if (!mark_.empty()) ports_.log.event(Severity::alarm, "campaign marked: " + mark_);
    finish(now);
}

void Campaign::begin_levelling(Time now) {
    const ZeroStatus known = zeros() != nullptr ? zeros()->status() : ZeroStatus{};
    if (for_zeroing()) {
        level_->aim({zeros()->target_deg(), known, {}});
    } else {
        level_->aim({here().stop.position_deg, known, {{here().run, here().position}}});
    }
    begin(*level_, State::levelling, now);
}

Time Campaign::levelling(Time now) {
    if (!ports_.rig.shaker.reading().at_rest()) {
        abort("the shaker left rest while the platform was levelled", now);
        return now;
    }
    const StageStep step = level_->step(now);
    if (step.kind == Came::going_on) return step.next;
    if (step.kind == Came::failed) {
        leave_stage();
        if (for_zeroing()) {
            fail_zeroing("levelling: " + step.why, now);
        } else {
            abort("levelling: " + step.why, now);
        }
    } else if (for_zeroing()) {
        zero_->levelled_at(level_->angle_rad());
        stage_ = zero_.get();
        enter(State::zeroing, now);
    } else {
        begin_dwell(now);
    }
    return now;
}

}  // namespace vibrig::campaign
