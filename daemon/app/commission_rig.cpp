#include "daemon/app/commission_rig.hpp"

#include "estimator/filter/angles.hpp"

namespace vibrig {
namespace {

commission::Vec3 in_degrees(const std::array<double, 3>& rad) {
    using estimator::kDegPerRad;
    return {rad[0] * kDegPerRad, rad[1] * kDegPerRad, rad[2] * kDegPerRad};
}

}  // namespace

commission::Look CommissionRig::sample() {
    const auto sample = parts_.acquisition.view().sample;
    return {sample.time, sample.time, in_degrees(sample.angle), sample.force,
            sample.angles_good() && sample.force_good()};
}

commission::Look CommissionRig::second() {
    const auto second = parts_.interlock.second();
    return {second.from, second.to, in_degrees(second.angle), second.force, second.good};
}

std::optional<commission::SampleRate> CommissionRig::rate() {
    return commission::SampleRate{
        parts_.acquisition.view().rate.hz(),
        1 / drivers::to_seconds(parts_.configuration.assembler.sample_period),
        parts_.fitness.rate_misfit()};
}

void CommissionRig::slew(const commission::Vec3& command_deg, drivers::Time now, bool counting) {
    // Where it stands and where it stops it is to stay, not to go by the middle of its travel.
    const auto sample = parts_.acquisition.view().sample;
    if (sample.angles_good()) parts_.gimbal.stands_at(in_degrees(sample.angle));
    parts_.gimbal.slew_to(command_deg, now, counting);
}

void CommissionRig::torque(const commission::Vec3& deg_per_h) {
    // As the commands are sent: the sign of the rate over them is what is looked for.
    commission::Vec3 rate{};
    for (std::size_t i = 0; i < 3; ++i)
        rate[i] = parts_.configuration.campaign.level.torquer.sign[i] * deg_per_h[i];
    // One that is not sent is sent again in the next round.
    static_cast<void>(parts_.torquer->command(rate));
}

void CommissionRig::count() {
    counted_rad_ = {};
    parts_.stage_feed.order(rt::StageFeed::Mode::increments);
}

commission::Vec3 CommissionRig::counted() {
    take_increments();
    parts_.stage_feed.order(rt::StageFeed::Mode::off);
    return in_degrees(counted_rad_);
}

void CommissionRig::take_increments() {
    if (!has_increments()) return;
    rt::Motion motion;
    while (parts_.stage_feed.pop(motion))
        for (std::size_t i = 0; motion.increment && i < 3; ++i) counted_rad_[i] += motion.turn[i];
}

}  // namespace vibrig
