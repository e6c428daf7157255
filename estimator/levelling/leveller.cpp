#include "estimator/levelling/leveller.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/levelling/refusal.hpp"

namespace vibrig::estimator::levelling {
namespace {

constexpr double kLeastTolerance = 0.05 * kRadPerArcmin;
constexpr double kLargestTolerance =
    5 * kRadPerArcmin;  // that the noise may ask for; beyond is not level
constexpr double kLargestTilt = 5 * kRadPerDeg;
constexpr int kMissingAllowed = 3;
constexpr double kSureness = 4;  // standard deviations

Gains between(const Gains& a, const Gains& b, double part) noexcept {
    return {a.k1 + part * (b.k1 - a.k1), a.k2 + part * (b.k2 - a.k2), a.k3 + part * (b.k3 - a.k3)};
}

std::size_t samples(const LevellerSettings& s) {
    require(std::isfinite(s.window_s) && s.window_s > 0 && s.window_s <= 3600, "window", s.window_s,
            "s, more than 0, at most 3600");
    return static_cast<std::size_t>(std::max(1.0, std::round(s.window_s / s.period_s)));
}

const LevellerSettings& checked(const LevellerSettings& s) {
    check_stable(s.fast);
    require(std::isfinite(s.settling_s) && s.settling_s > 0, "settling time", s.settling_s,
            "s, more than 0");
    check_period(s.period_s, mean_decay(s.fast), s.settling_s);
    require(s.torquer_limit > 0, "torquer limit", s.torquer_limit, "rad/s, more than 0");
    require(std::isfinite(s.tolerance_rad) && s.tolerance_rad >= 0, "tolerance", s.tolerance_rad,
            "rad, 0 or more");
    if (s.slow) {
        require(std::isfinite(s.ramp_s) && s.ramp_s > 0, "ramp", s.ramp_s, "s, more than 0");
        // Stable gains at both ends do not make those between stable.
        const int steps = static_cast<int>(std::min(1e5, std::ceil(s.ramp_s / s.period_s)));
        for (int i = 0; i <= steps; ++i) {
            check_stable(between(s.fast, *s.slow, static_cast<double>(i) / steps));
        }
    }
    return s;
}

}  // namespace

const char* name_of(Phase phase) noexcept {
    constexpr std::array kNames{"fast", "ramp", "slow", "undamped"};
    return kNames[static_cast<std::size_t>(phase)];
}

const char* name_of(Verdict verdict) noexcept {
    constexpr std::array kNames{"settling", "settled", "not settled", "cannot settle"};
    return kNames[static_cast<std::size_t>(verdict)];
}

void Leveller::Window::add(double value) noexcept {
    if (full()) {
        sum_ -= values_[next_];
    } else {
        ++filled_;
    }
    values_[next_] = value;
    sum_ += value;
    next_ = (next_ + 1) % values_.size();
    if (next_ == 0) {  // rounding does not pile up
        sum_ = 0;
        for (std::size_t i = 0; i < filled_; ++i) sum_ += values_[i];
    }
}

Leveller::Leveller(const LevellerSettings& settings)
    : settings_(checked(settings)),
      sigma_(mean_decay(settings.fast)),
      tolerance_(settings.tolerance_rad),
      budget_(noise_budget(settings.fast, settings.noise, settings.period_s, settings.earth)),
      axis_{FastNetwork(settings.earth), FastNetwork(settings.earth)},
      force_{Window(samples(settings)), Window(samples(settings))},
      rate_{Window(samples(settings)), Window(samples(settings))} {
    const double n = static_cast<double>(samples(settings));
    const double per_w =
        (1 + settings.fast.k2) / (settings.earth.radius_m * sigma_);  // rad per m/s
    force_noise_ = std::hypot(budget_.total, settings.noise.accelerometer_mps2 /
                                                 (settings.earth.gravity_mps2 * std::sqrt(n)));
    rate_noise_ = per_w * std::hypot(budget_.velocity, settings.noise.reference_mps / std::sqrt(n));
    if (tolerance_ == 0) {
        tolerance_ = std::clamp(tolerance_needed(), kLeastTolerance, kLargestTolerance);
    }
    if (tolerance_ < tolerance_needed()) {
        // A whole hold time within fewer standard deviations does not come about.
        verdict_ = Verdict::cannot_settle;
        note(Trouble::tolerance_below_noise, 0, tolerance_);
    }
    rate_tolerance_ = std::max(tolerance_, kSureness * rate_noise_);
}

double Leveller::tolerance_needed() const noexcept { return kSureness * force_noise_; }

std::optional<double> Leveller::window_needed_s() const noexcept {
    const double left = std::pow(tolerance_ / kSureness, 2) - std::pow(budget_.total, 2);
    if (left <= 0) return std::nullopt;
    const double one = settings_.noise.accelerometer_mps2 / settings_.earth.gravity_mps2;
    return settings_.period_s * std::max(1.0, std::ceil(one * one / left));
}

void Leveller::note(Trouble trouble, std::size_t channel, double value) noexcept {
    if (trouble_ == Trouble::drift_above_limit) {
        return;
    }
    if (trouble_ != trouble) {
        trouble_since_s_ = time_s_;
        trouble_value_ = value;
    } else if (std::abs(value) > std::abs(trouble_value_)) {
        trouble_value_ = value;
    }
    trouble_ = trouble;
    trouble_channel_ = channel;
}

bool Leveller::usable(const LevelInput& input) noexcept {
    if (input.missing) {
        if (++missing_in_a_row_ > kMissingAllowed) {
            note(Trouble::missing_samples, 0, missing_in_a_row_);
        }
        return false;
    }
    for (std::size_t i = 0; i < 2; ++i) {
        if (!std::isfinite(input.force[i]) || !std::isfinite(input.reference[i])) {
            missing_in_a_row_ = kMissingAllowed + 1;
            note(Trouble::not_a_number, std::isfinite(input.force[i]) ? i + 2 : i, 0);
            return false;
        }
    }
    missing_in_a_row_ = 0;
    return true;
}

Gains Leveller::gains_now() const noexcept {
    switch (phase_) {
        case Phase::fast:
            return settings_.fast;
        case Phase::ramp:
            return between(settings_.fast, *settings_.slow,
                           std::min(1.0, (time_s_ - ramp_begin_s_) / settings_.ramp_s));
        case Phase::slow:
            return *settings_.slow;
        case Phase::undamped:
            break;
    }
    return {};
}

LevelOutput Leveller::limited(Pair rate) noexcept {
    for (std::size_t i = 0; i < 2; ++i) {
        const double limit = settings_.torquer_limit;
        if (std::abs(rate[i]) > limit) {
            note(Trouble::torquer_limit, i, rate[i]);
            rate[i] = std::copysign(limit, rate[i]);
        }
    }
    last_rate_ = rate;
    return {rate, phase_, verdict_};
}

LevelOutput Leveller::held(const LevelInput& input) noexcept {
    for (std::size_t i = 0; i < 2; ++i) {
        force_[i].clear();
        rate_[i].clear();
    }
    held_s_ = 0;
    if (missing_in_a_row_ <= kMissingAllowed) {
        return {last_rate_, phase_, verdict_};
    }
    Pair rate{};
    for (std::size_t i = 0; i < 2; ++i) {
        rate[i] = axis_[i].held(std::isfinite(input.reference[i]) ? input.reference[i]
                                                                  : last_reference_[i]);
    }
    return limited(rate);
}

void Leveller::observe(const LevelInput& input) noexcept {
    const double per_w = (1 + settings_.fast.k2) / (settings_.earth.radius_m * sigma_);
    for (std::size_t i = 0; i < 2; ++i) {
        force_[i].add(input.force[i]);
        rate_[i].add(axis_[i].w());
        observables_.force_rad[i] = force_[i].mean() / settings_.earth.gravity_mps2;
        observables_.rate_rad[i] = per_w * rate_[i].mean();
    }
    last_reference_ = input.reference;
}

void Leveller::judge(const LevelInput& input) noexcept {
    bool quiet = force_[0].full();
    for (std::size_t i = 0; i < 2; ++i) {
        const double tilt = observables_.force_rad[i];
        if (static_cast<double>(force_[i].filled()) * settings_.period_s >=
                std::min(1.0, settings_.window_s) - 1e-9 &&
            std::abs(tilt) > kLargestTilt) {
            verdict_ = Verdict::cannot_settle;
            note(Trouble::tilt_too_large, i, tilt);
            return;
        }
        const double rate = observables_.rate_rad[i];
        if (std::abs(rate) > rate_tolerance_) {
            outside_ = {"rate of z", i, time_s_, rate, rate_tolerance_};
            quiet = false;
        }
        if (std::abs(tilt) > tolerance_) {
            outside_ = {"mean specific force", i, time_s_, tilt, tolerance_};
            quiet = false;
        }
    }
    held_s_ = quiet ? held_s_ + settings_.period_s : 0;
    if (quiet && held_s_ * sigma_ >= 1 && verdict_ != Verdict::cannot_settle) {
        // A jump just now is not yet in the means: the newest sample must not speak of one. On a
        // moving base, and with a noisy reference, that sample alone says nothing.
        const std::size_t i = std::abs(input.force[1]) > std::abs(input.force[0]) ? 1 : 0;
        const double newest = input.force[i] / settings_.earth.gravity_mps2;
        const double band = tolerance_ + kSureness * settings_.noise.accelerometer_mps2 /
                                             settings_.earth.gravity_mps2;
        const bool still = settings_.noise.reference_mps > 0 || input.reference != Pair{} ||
                           std::abs(newest) <= band;
        if (still) {
            verdict_ = Verdict::settled;
            settled_s_ = time_s_;
            if (settings_.slow) {
                phase_ = Phase::ramp;
                ramp_begin_s_ = time_s_;
            }
            return;
        }
        outside_ = {"newest specific force", i, time_s_, newest, band};
    }
    if (verdict_ == Verdict::settling && time_s_ > kPatience * settings_.settling_s) {
        verdict_ = Verdict::not_settled;
        for (std::size_t i = 0; i < 2; ++i) {
            if (trouble_ == Trouble::torquer_limit &&
                std::abs(last_rate_[i]) >= settings_.torquer_limit) {
                verdict_ = Verdict::cannot_settle;
                note(Trouble::drift_above_limit, i, trouble_value_);
            }
        }
    }
}

LevelOutput Leveller::step(const LevelInput& input) noexcept {
    time_s_ += settings_.period_s;
    if (!usable(input)) {
        const LevelOutput output = held(input);
        if (verdict_ == Verdict::settling && time_s_ > kPatience * settings_.settling_s) {
            verdict_ = Verdict::not_settled;
        }
        return output;
    }
    if (!started_) {
        started_ = true;
        for (std::size_t i = 0; i < 2; ++i) axis_[i].start(input.reference[i]);
    }
    const bool lost = !(input.reference_age_s <= 1 / (3 * sigma_));
    if (lost && phase_ != Phase::undamped) {
        const Gains before = gains_now();
        for (std::size_t i = 0; i < 2; ++i) axis_[i].become_undamped(last_reference_[i], before);
        phase_ = Phase::undamped;
        verdict_ = Verdict::cannot_settle;
        note(Trouble::reference_lost, 0, input.reference_age_s);
    }
    if (phase_ == Phase::ramp && time_s_ - ramp_begin_s_ >= settings_.ramp_s) {
        phase_ = Phase::slow;
    }
    const Gains gains = gains_now();
    Pair rate{};
    for (std::size_t i = 0; i < 2; ++i) {
        rate[i] = axis_[i].step(input.force[i], input.reference[i], gains, settings_.period_s);
        if (std::abs(rate[i]) > settings_.torquer_limit) {
            axis_[i].stop_integrator();
        }
    }
    const LevelOutput output = limited(rate);
    observe(input);
    if (verdict_ == Verdict::settling || verdict_ == Verdict::not_settled) {
        judge(input);
    }
    return {output.rate, phase_, verdict_};
}

double Leveller::drift_sigma() const noexcept {
    double left = 0;
    for (std::size_t i = 0; i < 2; ++i) {
        left = std::max(left,
                        std::abs(observables_.force_rad[i]) + std::abs(observables_.rate_rad[i]));
    }
    return std::hypot(budget_.drift, sigma_ * left);
}

std::string Leveller::message() const {
    const char* channel = trouble_channel_ % 2 == 0 ? "first" : "second";
    const auto remedy = [&]() -> std::string {
        const auto window = window_needed_s();
        return text(": expected at least %.3g'", at_least(tolerance_needed() / kRadPerArcmin, 3)) +
               (window ? text("; a window of %.4g s would do", at_least(*window, 4))
                       : std::string("; no window would do"));
    };
    const auto failure = [&]() -> std::string {
        switch (trouble_) {
            case Trouble::none:
                break;
            case Trouble::missing_samples:
                return text("samples missing since %.3f s: loop held, not integrating",
                            trouble_since_s_);
            case Trouble::not_a_number:
                return text(
                    "%s of the %s channel is not a number since %.3f s: loop held, not "
                    "integrating",
                    trouble_channel_ < 2 ? "specific force" : "reference velocity", channel,
                    trouble_since_s_);
            case Trouble::reference_lost:
                return text(
                    "external reference lost: fast network cannot be used without it (it "
                    "would follow the carrier's acceleration); switched to undamped at "
                    "%.3f s, reference %.3g s old",
                    trouble_since_s_, trouble_value_);
            case Trouble::tilt_too_large:
                return text(
                    "tilt of the %s channel is about %.3g deg: small-angle model not valid "
                    "above 5 deg, coarse levelling first",
                    channel, trouble_value_ * kDegPerRad);
            case Trouble::torquer_limit:
                return text(
                    "torquer limit %.6g deg/h reached on the %s channel at %.3f s: %.6g "
                    "deg/h demanded; saturated, integrator stopped",
                    settings_.torquer_limit / kDegPerHour, channel, trouble_since_s_,
                    trouble_value_ / kDegPerHour);
            case Trouble::tolerance_below_noise:
                return text(
                           "cannot settle: tolerance %.3g' is below %g times the noise of the mean "
                           "specific force over %.4g s, %.3g' (of that the tilt %.3g', mostly %s)",
                           trouble_value_ / kRadPerArcmin, kSureness, settings_.window_s,
                           force_noise_ / kRadPerArcmin, budget_.total / kRadPerArcmin,
                           budget_.dominant()) +
                       remedy();
            case Trouble::drift_above_limit:
                return text(
                    "cannot settle: the %s channel still demands more than the torquer "
                    "limit of %.6g deg/h",
                    channel, settings_.torquer_limit / kDegPerHour);
        }
        return "";
    }();
    if (verdict_ != Verdict::not_settled) {
        return failure;
    }
    return text("not settled within %.4g s: ", kPatience * settings_.settling_s) +
           (outside_.time_s < 0
                ? std::string("no whole window of samples")
                : text("%s of the %s channel was the last to leave its band, %.3g' against %.3g' "
                       "at %.4g s; noise %.3g' of the force, %.3g' of the rate, mostly %s",
                       outside_.what, outside_.channel == 0 ? "first" : "second",
                       outside_.value / kRadPerArcmin, outside_.band / kRadPerArcmin,
                       outside_.time_s, force_noise_ / kRadPerArcmin, rate_noise_ / kRadPerArcmin,
                       budget_.dominant())) +
           (failure.empty() ? "" : "; " + failure);
}

}  // namespace vibrig::estimator::levelling
