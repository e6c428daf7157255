#include "daemon/campaign/stages/zeroing.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

namespace vibrig::campaign {

using drivers::GimbalState;
using drivers::Time;

void Zeroing::begin(Time /*now*/) {
    part_ = Part::go;
    calibration_.begin();
}

void Zeroing::levelled_at(const Vector& encoder_rad) { calibration_.levelled_at(encoder_rad); }

StageStep Zeroing::step(Time now) {
    if (part_ == Part::go) {
        rig_.gimbal.slew_to(calibration_.target_deg(), now);
        part_ = Part::slew;
    }
    const auto gimbal = rig_.gimbal.update(rig_.platform(), now);
    if (gimbal == GimbalState::timed_out || gimbal == GimbalState::no_status)
        return StageStep::failed(fmt::format("gimbals: {}", drivers::name_of(gimbal)));
    const bool there = gimbal == GimbalState::in_position;
    if (part_ == Part::measure) return measure(there, now);
    if (there && levels_ && !calibration_.levelled()) {
        rig_.gimbal.release(now);
        part_ = Part::go;
        return StageStep::asks();
    }
    if (there) {
        rig_.feed->order(rt::StageFeed::Mode::increments);
        last_motion_ = now;
        calibration_.arrived();
        rig_.gimbal.slew_to(calibration_.target_deg(), now, true);
        part_ = Part::measure;
    }
    return StageStep::going_on(std::min(rig_.gimbal.next_deadline(), now + kStagePoll));
}

StageStep Zeroing::measure(bool there, Time now) {
    rt::Motion motion;
    while (!calibration_.over() && rig_.feed->pop(motion)) {
        last_motion_ = now;
        calibration_.add(motion);
    }
    if (calibration_.over()) return end(now);
    if (now - last_motion_ > kSilence)
        return StageStep::failed("no increments of gyros and accelerometers on the bus for 1 s");
    if (there) {
        calibration_.arrived();
        rig_.gimbal.slew_to(calibration_.target_deg(), now, true);
    }
    return StageStep::going_on(std::min(rig_.gimbal.next_deadline(), now + kStagePoll));
}

StageStep Zeroing::end(Time now) {
    if (calibration_.another()) {
        rig_.feed->order(rt::StageFeed::Mode::off);
        calibration_.begin_other_way();
        part_ = Part::go;
        return StageStep::going_on(now);
    }
    leave();
    if (auto failure = calibration_.finish(at_end_); !failure.empty())
        return StageStep::failed(std::move(failure));
    log_.event(Severity::info, calibration_.words());
    return StageStep::done();
}

}  // namespace vibrig::campaign
