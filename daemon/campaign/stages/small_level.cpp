#include "daemon/campaign/stages/small_level.hpp"

namespace vibrig::campaign {

using drivers::Time;

namespace {
// What is called rest has to be so many times the noise.
constexpr double kNoises = 6;
}  // namespace

void SmallLevel::begin(const std::string& by, double table_g, Time now) {
    level_g = table_g;
    proof.begin(by, table_g);
    loop.measure();
    ports.rig.feed->order(rt::StageFeed::Mode::samples);
    last_motion_ = now;
}

std::string SmallLevel::look_at_rest(Time now) {
    auto position_deg = excitation.position_deg();
    auto still = loop.look(position_deg);
    excitation.place(position_deg);
    if (!still.empty()) return still;
    if (!stop.rest(now).measured()) return "not at rest: " + stop.what_moves(now);
    return quiet() ? "" : "the noise at rest is too near to shaker.rest_g";
}

/// Rest is called by what is well above the noise of those who call it.
bool SmallLevel::quiet() {
    loop.rests();
    const auto noise = loop.noise();
    const double limit_g = settings.rest.limit_g / kNoises;
    if (noise.table_g > 0) proof.row("noise at rest, table", "g", noise.table_g, 0, limit_g);
    proof.row("noise at rest, platform", "g", noise.platform_g, 0, limit_g);
    return proof.record().rows.back().passed();
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
    return excitation.off_command(level_g, now);
}

StageStep SmallLevel::come_to_rest(Time now) {
    switch (excitation.come_to_rest(now)) {
        case Excitation::Rests::not_yet:
            break;
        case Excitation::Rests::at_rest:
            return StageStep::done();
        case Excitation::Rests::overdue:
            return StageStep::failed("the shaker did not come to rest in time");
    }
    return StageStep::going_on(now + kStagePoll);
}

std::optional<bool> SmallLevel::fault_cleared(Time now) const {
    const auto reading = ports.rig.shaker.reading();
    const Time since = excitation.since();
    if (!stop.stopping() && reading.time > since && reading.at_rest() && reading.fault == 0)
        return true;
    if (now - since <= drivers::from_seconds(2 * stop.longest_s(level_g))) return std::nullopt;
    return false;
}

void SmallLevel::begin_part(bool steady, Proving what, Time now) {
    excitation.begin_part(now);
    ports.rig.proving(what);
    ports.rig.commanded(steady ? level_g : 0, excitation.position_deg());
    ports.rig.guard(rt::Guard::excitation);
}

}  // namespace vibrig::campaign
