#include "daemon/campaign/sweep_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>

namespace vibrig::campaign {

using drivers::Time;

namespace {

// A register resolves 1 mHz; a controller's own measurement of it is less sure.
constexpr double kResolved = 2e-3;
// One second may be spoilt by a register that comes late.
constexpr int kMostSpoilt = 2;

}  // namespace

double SweepWatch::dwell_s(const estimator::SweptSine& sweep) {
    return kBegins_s + kLate_s + (1 + kLate) * sweep.seconds;
}

SweepWatch::SweepWatch(const estimator::Settings& rig, const rt::DwellOrder& order, Time at_level)
    : of_(order.dwell.sweep),
      octaves_(std::abs(std::log2(of_.to_hz / of_.from_hz))),
      from_(order.from),
      at_level_(at_level),
      zero_g_(order.zero_g),
      read_(rig, order.dwell.run, order.dwell.position) {}

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
        return fmt::format("the controller says {:g} Hz, {}", hz, asked);
    const double way = std::log(hz / of_.from_hz) / std::log(of_.to_hz / of_.from_hz);
    const double slack = kResolved / std::abs(std::log(of_.to_hz / of_.from_hz));
    if (way < -slack || way > 1 + slack)
        return fmt::format(
            "the controller is at {:.3f} Hz, {}: {}", hz, asked,
            way < 0 ? "it goes the other way, or stands elsewhere" : "it goes beyond its end");
    read_.frequency(time_s, hz);
    if (way <= slack && !began_s_) {
        if (drivers::to_seconds(at - at_level_) <= kBegins_s) return contradicted();
        return fmt::format("the controller stands still at {:.3f} Hz {:g} s after its level, {}",
                           hz, kBegins_s, asked);
    }
    const double begins_s = time_s - way * of_.seconds;
    if (!began_s_) began_s_ = begins_s;
    const double lasted_s = std::max(0.0, time_s - *began_s_);
    // At its end it stays.
    const double late_s = begins_s - *began_s_;
    const double may_s = kLate_s + kLate * std::min(lasted_s, of_.seconds);
    if (late_s < -may_s || (late_s > may_s && way < 1 - slack))
        return fmt::format("the controller is at {:.3f} Hz {:.1f} s after it began, {}", hz,
                           lasted_s, asked);
    if (way < 1 - slack) begins_s_ = begins_s;
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

/// What the accelerometers show of the frequencies that the controller says.
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
