#include "daemon/campaign/sweep_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>

namespace vibrig::campaign {

using drivers::Time;

namespace {

// One second may be spoilt by a register that comes late.
constexpr int kMostSpoilt = 2;

}  // namespace

SweepWatch::SweepWatch(const estimator::Settings& rig, const rt::DwellOrder& order, Time at_level,
                       const estimator::spectrum::SweptBy& by)
    : of_(order.dwell.sweep),
      bounds_(of_, by),
      step_hz_(by.frequency_step_hz),
      octaves_(std::abs(std::log2(of_.to_hz / of_.from_hz))),
      from_(order.from),
      at_level_(at_level),
      zero_g_(order.zero_g),
      read_(rig, order.dwell.run, order.dwell.position) {}

bool SweepWatch::moved() const {
    constexpr double kRounding = 1 + 1e-6;
    const auto& all = read_.readings();
    return !all.empty() && std::abs(all.back()[1] - of_.from_hz) > kRounding * step_hz_;
}

std::optional<Time> SweepWatch::begun() const {
    if (!begins_s_) return {};
    return from_ + static_cast<Time>(*begins_s_ * static_cast<double>(drivers::kSecond));
}

std::string SweepWatch::frequency(Time at, double hz) {
    const std::string asked =
        fmt::format("a sweep from {:g} to {:g} Hz in {:g} s was asked for and read back",
                    of_.from_hz, of_.to_hz, of_.seconds);
    const double time_s = drivers::to_seconds(at - from_);
    if (!(std::isfinite(hz) && hz > 0))
        return fmt::format("the controller reports {:g} Hz, {}", hz, asked);
    // Hz past its beginning and its end, in the direction of the sweep.
    const double direction = of_.to_hz > of_.from_hz ? 1 : -1;
    const double gone_hz = direction * (hz - of_.from_hz), over_hz = direction * (hz - of_.to_hz);
    if (gone_hz < -bounds_.off_hz() || over_hz > bounds_.off_hz())
        return fmt::format(
            "the controller is at {:.3f} Hz, {}: {}", hz, asked,
            gone_hz < 0 ? "it goes the other way, or stands elsewhere" : "it goes beyond its end");
    read_.frequency(time_s, hz);
    if (gone_hz <= bounds_.off_hz() && !began_s_) {
        if (drivers::to_seconds(at - at_level_) <= bounds_.begins_s()) return contradicted();
        return fmt::format("the controller stands still at {:.3f} Hz {:.1f} s after its level, {}",
                           hz, bounds_.begins_s(), asked);
    }
    const double way = std::log(hz / of_.from_hz) / std::log(of_.to_hz / of_.from_hz);
    const double begins_s = time_s - way * of_.seconds;
    if (!began_s_) began_s_ = begins_s;
    const double lasted_s = time_s - *began_s_, late_s = begins_s - *began_s_;
    const double may_s = bounds_.late_s(hz, lasted_s);
    const bool there = over_hz >= -bounds_.off_hz();  // where it stays
    if (late_s < -may_s || (late_s > may_s && !there))
        return fmt::format("the controller is at {:.3f} Hz {:.1f} s after it began, {}", hz,
                           lasted_s, asked);
    if (!there) begins_s_ = begins_s;
    return contradicted();
}

void SweepWatch::add(const rt::Motion& motion) {
    if (motion.time < from_) return;
    read_.add({.time_s = drivers::to_seconds(motion.time - from_),
               .angle_rad = motion.angle,
               .force_g = {motion.force[0] - zero_g_[0], motion.force[1] - zero_g_[1],
                           motion.force[2] - zero_g_[2]},
               .angles_good = motion.good,
               .force_good = motion.good});
}

/// What the accelerometers show of the frequencies that the controller reports.
std::string SweepWatch::contradicted() {
    using estimator::spectrum::SweepBlocks;
    const auto& shares = read_.shares();
    for (; judged_ < shares.size(); ++judged_) {
        in_a_row_ = shares[judged_] < SweepBlocks::kShown ? in_a_row_ + 1 : 0;
        if (in_a_row_ <= kMostSpoilt) continue;
        return fmt::format(
            "the accelerometers show {:.2f} of their power at the frequency that the controller "
            "says ({:.3f} Hz), expected {:g} at least: they vibrate at another",
            shares[judged_], read_.readings().back()[1], SweepBlocks::kShown);
    }
    return {};
}

}  // namespace vibrig::campaign
