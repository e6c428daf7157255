#include "daemon/campaign/stages/small_level.hpp"

namespace vibrig::campaign {

using drivers::Time;

void SmallLevel::begin(Time now) {
    ports.rig.feed->order(rt::StageFeed::Mode::samples);
    last_motion_ = now;
}

void SmallLevel::take_samples(Time now) {
    rt::Motion motion;
    while (ports.rig.feed->pop(motion)) {
        last_motion_ = now;
        loop.add(motion);
    }
}

std::string SmallLevel::lacks(Time now) {
    take_samples(now);
    if (now - last_motion_ > kSilence) return "samples ceased";
    return platform_lacks(ports.rig.platform(), now);
}

std::string SmallLevel::off_command(Time now) {
    if (ports.rig.shaker.reading().emergency_stop_open) return {};
    return excitation.off_command(settings.loop.table_g, now);
}

void SmallLevel::begin_part(bool steady, Proving what, Time now) {
    excitation.begin_part(now);
    ports.rig.proving(what);
    ports.rig.commanded(steady ? settings.loop.table_g : 0, excitation.position_deg());
    ports.rig.guard(rt::Guard::excitation);
}

}  // namespace vibrig::campaign
