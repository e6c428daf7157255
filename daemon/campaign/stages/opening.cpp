#include "daemon/campaign/stages/opening.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

namespace vibrig::campaign {

using drivers::GimbalState;
using drivers::Time;

std::string may_slew(const Rig& rig, const StopMonitor& stop) {
    const auto reading = rig.shaker.reading();
    if (!reading.at_rest() || stop.stopping())
        return fmt::format(
            "gimbals slew at rest only: the shaker is in state {}, measured {:.3f} g",
            reading.state, reading.measured_g);
    return {};
}

void Opening::begin(Time /*now*/) {
    check_.begin();
    part_ = Part::go;
}

StageStep Opening::step(Time now) {
    if (part_ == Part::go) {
        if (const auto why = may_slew(rig_, stop_); !why.empty()) return StageStep::failed(why);
        rig_.gimbal.slew_to(check_.target_deg(), now);
        part_ = Part::slew;
    }
    const auto gimbal = rig_.gimbal.update(rig_.platform(), now);
    if (gimbal == GimbalState::timed_out || gimbal == GimbalState::no_status)
        return StageStep::failed(fmt::format("gimbals: {}", drivers::name_of(gimbal)));
    if (part_ == Part::slew && gimbal == GimbalState::in_position) {
        if (check_.drifts()) rig_.gimbal.release(now);
        part_ = Part::release;
    }
    if (part_ == Part::release) {
        // Let go is what says so itself.
        if (check_.drifts() && rig_.gimbal.state() == GimbalState::commanding)
            return StageStep::going_on(std::min(rig_.gimbal.next_deadline(), now + kStagePoll));
        check_.arrived(now);
        part_ = Part::measure;
    } else if (part_ == Part::measure) {
        // While it slews a platform may report that it is not ready.
        if (auto why = platform_lacks(rig_.platform(), now); !why.empty())
            return StageStep::failed(std::move(why));
        check_.add(rig_.second().value_or(rt::MeanMotion{}));
        if (check_.measured()) {
            part_ = Part::go;
            return check_.next() ? StageStep::going_on(now) : StageStep::done();
        }
        if (check_.overdue(now))
            return StageStep::failed("no still seconds: force or angles are missing or move");
    }
    return StageStep::going_on(std::min(rig_.gimbal.next_deadline(), now + kStagePoll));
}

}  // namespace vibrig::campaign
