#include "daemon/campaign/stages/stage.hpp"

namespace vibrig::campaign {

using drivers::Time;

bool platform_is_silent(const drivers::PlatformStatus& platform, Time now) {
    constexpr Time kPlatformDeadline = drivers::kSecond;
    return platform.time == 0 || now - platform.time > kPlatformDeadline;
}

std::string platform_lacks(const drivers::PlatformStatus& platform, Time now) {
    if (platform_is_silent(platform, now))
        return "no platform status on the bus: loop and fault have to come each second, changed or "
               "not";
    if (platform.fault) return "platform fault";
    if (!platform.ready || !platform.gyros_at_speed) return "platform not ready";
    if (!platform.loop_closed) return "stabilisation loop open";
    return {};
}

bool torquing(const Rig& rig) {
    return rig.feed != nullptr && rig.feed->knows_torque() && rig.feed->torque().torquing;
}

void let_go(Rig& rig) {
    if (rig.feed != nullptr) rig.feed->order(rt::StageFeed::Mode::off);
    if (rig.torquer != nullptr && !rig.torquer->zero()) static_cast<void>(rig.torquer->command({}));
}

}  // namespace vibrig::campaign
