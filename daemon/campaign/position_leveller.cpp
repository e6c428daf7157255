#include "daemon/campaign/position_leveller.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimator/filter/angles.hpp"
#include "estimator/levelling/refusal.hpp"

namespace vibrig::campaign {

namespace level = estimator::levelling;

namespace {

constexpr double kSmallAngle = 5 * estimator::kRadPerDeg;

/// What is stable and sampled well enough; names the key.
void check(const LevellingSettings& s, const level::LevellerSettings& loop) {
    const double steps_s = level::mean_decay(loop.fast) * s.settling_s * loop.period_s;
    if (const double least_s = steps_s / level::kMostStep; s.settling_s < least_s)
        throw level::DesignError(fmt::format(
            "levelling.settling_s: found {:g}, expected at least {:g}, since the loop takes a step "
            "each {:.3g} s",
            s.settling_s, level::at_least(least_s, 3), loop.period_s));
    if (!loop.slow) return;
    try {
        const level::Leveller trial(loop);
    } catch (const level::DesignError& error) {
        throw level::DesignError(fmt::format(
            "levelling.slow_settling_s: found {:g}, expected nearer to levelling.settling_s = "
            "{:g}: on the way from the ones to the others {}",
            s.slow_settling_s, s.settling_s, error.what()));
    }
}

level::LevellerSettings loop_of(const LevellingSettings& s, const estimator::Settings& rig,
                                double sample_s, double torquer_limit_deg_h) {
    level::LevellerSettings loop;
    loop.earth.gravity_mps2 = rig.gravity_mps2;
    loop.fast = level::design({s.settling_s, s.residual, s.damping}, loop.earth).gains;
    loop.settling_s = s.settling_s;
    if (s.slow_settling_s > 0) {
        loop.slow = level::design({s.slow_settling_s, s.residual, s.damping}, loop.earth).gains;
    }
    loop.ramp_s = s.slow_ramp_s;
    const std::uint32_t block = levelling_block(sample_s);
    loop.period_s = block * sample_s;
    loop.window_s = s.window_s;
    loop.tolerance_rad = s.tolerance_arcmin * estimator::kRadPerArcmin;
    loop.torquer_limit =
        std::min(s.torquer_limit_deg_h, torquer_limit_deg_h) * estimator::kDegPerHour;
    loop.noise.accelerometer_mps2 =
        rig.accelerometer_g * rig.gravity_mps2 / std::sqrt(static_cast<double>(block));
    if (!s.velocity_north.empty()) loop.noise.reference_mps = s.velocity_noise_mps;
    loop.noise.gyro_random_walk = rig.gyro_random_walk_deg_per_rt_h * estimator::kDegPerRootHour;
    check(s, loop);
    return loop;
}

}  // namespace

std::uint32_t levelling_block(double sample_s) {
    constexpr double kStep_s = 0.1;
    if (!(sample_s > 0))
        throw std::invalid_argument(
            fmt::format("levelling: {:g} s between samples found, expected above 0", sample_s));
    return static_cast<std::uint32_t>(std::max(1.0, std::round(kStep_s / sample_s)));
}

PositionLeveller::PositionLeveller(const LevellingSettings& settings,
                                   const estimator::Settings& rig, double sample_s,
                                   double torquer_limit_deg_h)
    : settings_(settings),
      rig_(rig),
      frame_(rig),
      loop_(loop_of(settings, rig, sample_s, torquer_limit_deg_h)),
      leveller_(loop_) {}

std::string PositionLeveller::refusal() const {
    const level::Leveller loop(loop_);
    const double most_s = (level::kPatience - 1) * settings_.settling_s - 1 / loop.sigma();
    if (settings_.window_s > most_s)
        return fmt::format(
            "levelling.window_s: found {:g}, expected at most {:g} with levelling.settling_s = "
            "{:g}: a levelling is given {:g} settling times to settle, fill the window, and hold",
            settings_.window_s, level::at_most(most_s, 3), settings_.settling_s, level::kPatience);
    if (loop.verdict() != level::Verdict::cannot_settle) return {};
    const auto window = loop.window_needed_s();
    return fmt::format(
        "levelling.tolerance_arcmin: found {:g}, expected at least {:g} with levelling.window_s "
        "= {:g}, noise.accelerometer_g = {:g} and noise.gyro_random_walk_deg_per_rt_h = {:g} (four "
        "times the noise of the mean specific force, mostly {}){}",
        settings_.tolerance_arcmin,
        level::at_least(loop.tolerance_needed() / estimator::kRadPerArcmin, 3), settings_.window_s,
        rig_.accelerometer_g, rig_.gyro_random_walk_deg_per_rt_h, loop.budget().dominant(),
        window
            ? fmt::format(", or levelling.window_s of at least {:g}", level::at_least(*window, 3))
            : "");
}

void PositionLeveller::begin(const Vector& encoder_deg, const ZeroStatus& zeros) {
    leveller_.emplace(loop_);
    largest_at_first_ = 0;
    counted_ = false;
    const Vector up = frame_.up_at_deg(encoder_deg);
    // Any two directions normal to the vertical: first x second = up.
    std::size_t least = 0;
    for (std::size_t i = 1; i < 3; ++i)
        if (std::abs(up[i]) < std::abs(up[least])) least = i;
    Vector first{};
    first[least] = 1;
    const double share = up[least];
    for (std::size_t i = 0; i < 3; ++i) first[i] -= share * up[i];
    const double length = std::sqrt(dot(first, first));
    for (double& part : first) part /= length;
    channel_ = {first, cross(up, first)};
    north_east_ = frame_.north_east_at_deg(encoder_deg);
    zero_g_ = {};
    limit_rad_ = 0;
    if (zeros.known) {
        for (std::size_t i = 0; i < 3; ++i) zero_g_[i] = 1e-3 * zeros.zero_mg[i];
        // What is left in the end is minus the zero over g.
        for (const Vector& c : channel_) {
            limit_rad_ = std::max(
                limit_rad_, 1e-3 * std::sqrt(std::max(0.0, quadratic(zeros.covariance_mg2, c))));
        }
    }
}

Vector PositionLeveller::to_axes(const level::Pair& rate) const {
    // The vertical goes round against the platform: u' = u x w. So a turn about the second channel
    // takes the first down, and one about the first takes the second up.
    Vector axes{};
    for (std::size_t i = 0; i < 3; ++i) {
        axes[i] = (rate[0] * channel_[1][i] - rate[1] * channel_[0][i]) / estimator::kDegPerHour;
    }
    // Two channels at their limit add up to more on an axis that lies between them.
    const double limit = loop_.torquer_limit / estimator::kDegPerHour;
    double largest = limit;
    for (const double axis : axes) largest = std::max(largest, std::abs(axis));
    for (double& axis : axes) axis *= limit / largest;
    return axes;
}

Vector PositionLeveller::step(const rt::Motion& motion) {
    level::LevelInput input;
    input.reference_age_s = motion.velocity_age_s;
    for (std::size_t i = 0; i < 2; ++i) {
        input.reference[i] = motion.velocity[0] * dot(channel_[i], north_east_[0]) +
                             motion.velocity[1] * dot(channel_[i], north_east_[1]);
    }
    for (std::uint32_t i = 0; i < std::min<std::uint32_t>(motion.dropped_before, 100); ++i) {
        input.missing = true;
        static_cast<void>(leveller_->step(input));
    }
    input.missing = !motion.good;
    if (motion.good) {
        Vector force = frame_.force(motion.force, 1);
        for (std::size_t i = 0; i < 3; ++i) force[i] -= zero_g_[i];
        for (std::size_t i = 0; i < 2; ++i)
            input.force[i] = rig_.gravity_mps2 * dot(channel_[i], force);
        if (leveller_->time_s() < 1) {
            const double tilt = std::max(std::abs(input.force[0]), std::abs(input.force[1]));
            largest_at_first_ = std::max(largest_at_first_, tilt / rig_.gravity_mps2);
        }
    }
    const auto output = leveller_->step(input);
    if (done() && !std::exchange(counted_, true)) ++done_;
    return to_axes(output.rate);
}

bool PositionLeveller::done() const {
    const auto& l = *leveller_;
    if (l.verdict() != level::Verdict::settled) return false;
    return !loop_.slow || l.time_s() - l.settled_s().value_or(0) >= loop_.ramp_s;
}

std::string PositionLeveller::failure() const {
    const level::Verdict verdict = leveller_->verdict();
    if (verdict != level::Verdict::cannot_settle && verdict != level::Verdict::not_settled)
        return {};
    std::string why = leveller_->message();
    if (verdict == level::Verdict::cannot_settle && why.find("cannot settle") == std::string::npos)
        why = "cannot settle: " + why;
    if (leveller_->trouble() == level::Trouble::tilt_too_large && largest_at_first_ < kSmallAngle) {
        why += fmt::format(
            "; it was {:.3g} deg at first and grows under the torquing: sign or axes of the "
            "torquers",
            largest_at_first_ * estimator::kDegPerRad);
    }
    return why;
}

std::string PositionLeveller::words() const {
    const auto& l = *leveller_;
    const auto drift = l.drift();
    std::string text = fmt::format(
        "level after {:.1f} s: mean specific force {:+.3f}' and {:+.3f}', tolerance {:.3g}'; drift "
        "{:+.3f} and {:+.3f} deg/h",
        l.settled_s().value_or(l.time_s()), l.observables().force_rad[0] / estimator::kRadPerArcmin,
        l.observables().force_rad[1] / estimator::kRadPerArcmin,
        l.tolerance() / estimator::kRadPerArcmin, drift[0] / estimator::kDegPerHour,
        drift[1] / estimator::kDegPerHour);
    if (limit_rad_ > 0)
        text += fmt::format("; {:.3g}' (1 sigma) from the zeros",
                            limit_rad_ / estimator::kRadPerArcmin);
    if (const auto note = l.message(); !note.empty()) text += "; " + note;
    return text;
}

LevelDrift PositionLeveller::drift(const Vector& encoder_rad) const {
    LevelDrift found;
    found.encoder_rad = encoder_rad;
    found.direction = channel_;
    // The torquers held against it; see to_axes().
    const auto torqued = leveller_->drift();
    found.rate_deg_h = {torqued[1] / estimator::kDegPerHour, -torqued[0] / estimator::kDegPerHour};
    found.sigma_deg_h = leveller_->drift_sigma() / estimator::kDegPerHour;
    return found;
}

void PositionLeveller::fill(LevellingStatus& status) const {
    const auto& l = *leveller_;
    status.begun = l.time_s() > 0;
    status.verdict = level::name_of(l.verdict());
    status.time_s = l.settled_s().value_or(l.time_s());
    for (std::size_t i = 0; i < 2; ++i) {
        status.tilt_arcmin[i] = l.observables().force_rad[i] / estimator::kRadPerArcmin;
        status.to_come_arcmin[i] = l.observables().rate_rad[i] / estimator::kRadPerArcmin;
        status.drift_deg_h[i] = l.drift()[i] / estimator::kDegPerHour;
    }
    status.phase = l.verdict() == level::Verdict::settled && loop_.slow ? "ramp" : "fast";
    status.tolerance_arcmin = l.tolerance() / estimator::kRadPerArcmin;
    status.noise_arcmin = l.budget().total / estimator::kRadPerArcmin;
    status.limit_arcmin = limit_rad_ / estimator::kRadPerArcmin;
    status.done = done_;
    status.message = failure();
    if (status.message.empty()) status.message = l.message();
}

double PositionLeveller::expected_s() const noexcept {
    return settings_.settling_s + settings_.window_s + 1 / level::mean_decay(loop_.fast) +
           (loop_.slow ? loop_.ramp_s : 0);
}

}  // namespace vibrig::campaign
