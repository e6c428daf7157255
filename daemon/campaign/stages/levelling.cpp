#include "daemon/campaign/stages/levelling.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <tuple>

namespace vibrig::campaign {

using drivers::Time;

StageStep Levelling::step(Time now) {
    Rig& rig = ports_.rig;
    const auto gimbal = rig.gimbal.update(rig.platform(), now);
    if (part_ == Part::go) {
        if (gimbal == drivers::GimbalState::commanding)
            return StageStep::going_on(std::min(rig.gimbal.next_deadline(), now + kStagePoll));
        if (gimbal != drivers::GimbalState::idle)
            return StageStep::failed(
                fmt::format("gimbals not released: {}", drivers::name_of(gimbal)));
        leveller_.begin(aim_.encoder_deg, aim_.zeros);
        rig.feed->order(rt::StageFeed::Mode::force);
        last_motion_ = now;
        part_ = Part::measure;
    }
    return part_ == Part::measure ? measure(now) : confirm_zero(now);
}

StageStep Levelling::measure(Time now) {
    rt::Motion motion;
    Vector rate{};
    bool any = false;
    while (!leveller_.done() && leveller_.failure().empty() && ports_.rig.feed->pop(motion)) {
        last_motion_ = now;
        rate = leveller_.step(motion);
        angle_rad_ = motion.angle;
        any = true;
    }
    if (auto why = leveller_.failure(); !why.empty()) return StageStep::failed(std::move(why));
    if (leveller_.done()) {
        leave();
        ports_.log.event(Severity::info, leveller_.words());
        if (aim_.run_and_position) {
            auto drift = leveller_.drift(angle_rad_);
            std::tie(drift.run, drift.position) = *aim_.run_and_position;
            ports_.dwells.levelled(drift);
        }
        part_ = Part::zero;
        torque_sent_ = zero_since_ = now;
        return StageStep::going_on(now + kStagePoll);
    }
    if (any) static_cast<void>(ports_.rig.torquer->command(rate));
    if (now - last_motion_ > kSilence)
        return StageStep::failed("no specific force on the bus for 1 s");
    return StageStep::going_on(now + kStagePoll);
}

/// A dwell is free drift: it begins only when the platform itself reports that nothing is torqued.
StageStep Levelling::confirm_zero(Time now) {
    constexpr Time kZeroTimeout = 2 * drivers::kSecond;
    Rig& rig = ports_.rig;
    const auto torque = rig.feed->torque();
    const bool confirmed =
        !rig.feed->knows_torque() ||
        (torque.time > zero_since_ && !torque.torquing && torque.echo == rig.torquer->counter());
    if (rig.torquer->zero() && confirmed) return StageStep::done();
    if (now - zero_since_ > kZeroTimeout)
        return StageStep::failed(
            "torquing commanded to zero, not confirmed by the platform within 2 s");
    if (now - torque_sent_ >= kStagePoll) {
        torque_sent_ = now;
        static_cast<void>(rig.torquer->command({}));
    }
    return StageStep::going_on(now + kStagePoll / 2);
}

}  // namespace vibrig::campaign
