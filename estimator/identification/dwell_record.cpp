#include "estimator/identification/dwell_record.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/level/vibration_level.hpp"

namespace vibrig::estimator {
namespace {

constexpr double kForceTolerance = 0.02;     ///< of 1 g, spec section 6.3 of the method
constexpr double kRejectedTolerance = 0.01;  ///< of the samples
/// Of the samples: of angles as noisy as configured 2e-5 are beyond the gate, of angles twice as
/// noisy 10 %. Beyond that what the gate lets pass agrees with any prediction.
constexpr double kMostGated = 0.12;
constexpr double kLevelTolerance = 0.1;  ///< change of kappa within a dwell
/// The same, followed but reported: above what an amplitude held within 0.3 % does, below one that
/// drifts by 2 %. With more readings missing than this share the level itself is not so sure.
constexpr double kLevelDrift = 0.025;
constexpr double kMostFilled = 0.05;
constexpr double kLeastReadings = 0.5;  ///< of those that a steady rate would give
/// Intervals that are part of a period, of the readings: where most are lost, the median interval
/// is that of two or more periods. Not those of nothing: stamps may come in pairs.
constexpr double kCrowdedTolerance = 0.25;
constexpr double kCrowdedFrom = 0.1, kCrowdedTo = 0.6;
constexpr double kOffFrequency_hz = 0.05;  ///< where a frequency was commanded
// Of random vibration: what a mean or a level strays by where all is well.
constexpr double kForceSigmas = 5, kLevelSigmas = 4;
constexpr double kShaken = 1.001;  ///< kappa; below, its error does no harm
/// kappa whose whole excess, at 0.03 deg/h/g^2, is 0.3 of the noise of a dwell of 100 s, 0.007
/// deg/h: what a blower does at rest is less, and need not be understood.
constexpr double kNotJudged = 1.07;

constexpr const char* kSaturated[3] = {"accelerometer x is saturated: dwell rejected",
                                       "accelerometer y is saturated: dwell rejected",
                                       "accelerometer z is saturated: dwell rejected"};

}  // namespace

void DwellRecord::count(const StepResult& step) noexcept {
    switch (step.outcome) {
        case StepOutcome::used:
            for (std::size_t k = 0; k < 3; ++k) {
                const double innovation = step.innovation_arcsec[k];
                innovation_square += innovation * innovation;
                if (last_used) innovation_product += innovation * last_innovation[k];
            }
            nis_sum += step.nis;
            ++nis_count;
            ++used;
            break;
        case StepOutcome::initialised:
        case StepOutcome::bad_force:
            ++used;
            break;
        case StepOutcome::reinitialised:
            ++reinitialised;
            ++gated;
            ++rejected;
            break;
        case StepOutcome::gated:
            ++gated;
            ++rejected;
            break;
        case StepOutcome::bad_angles:
        case StepOutcome::bad_time:
            ++rejected;
            break;
        case StepOutcome::buffered:
            break;
    }
    last_used = step.outcome == StepOutcome::used;
    last_innovation = step.innovation_arcsec;
}

void DwellRecord::note_swept(const std::array<double, 3>& force_g) noexcept {
    ++forces;
    for (std::size_t i = 0; i < 3; ++i) {
        force_sum[i] += force_g[i];
        force_square += force_g[i] * force_g[i];
    }
}

void DwellRecord::note_level(double kappa) noexcept {
    least_kappa = least_kappa > 0 ? std::min(least_kappa, kappa) : kappa;
    largest_kappa = std::max(largest_kappa, kappa);
}

void DwellRecord::note_interval(double periods) noexcept {
    slots += std::max(1.0, std::round(periods));
    if (periods >= kCrowdedFrom && periods < kCrowdedTo) ++crowded;
}

/// In place of a sine's level.
RandomLevel::Level take_random_level(const DwellRecord& r, const Settings& settings,
                                     DwellSummary& s) noexcept {
    const bool reported = r.played && r.played->word == PlayedRandom::Word::good;
    RandomVibration shown = reported ? r.played->random : r.info.random;
    const Seen seen = reported ? r.played->seen : r.seen;
    shown.mean_square_g2 *= seen.share;
    const auto level = r.random_level.level(shown, settings.accelerometer_g, r.period_s, r.span_s);
    s.kappa = 1 + level.mean_square_g2 / seen.share;
    s.relative_error = std::hypot(level.relative_error, seen.error);
    s.mean_force_g = level.mean_force_g;
    s.amplitude_g = std::sqrt(2 * (s.kappa - 1));
    s.frequency_hz = 0;
    return level;
}

/// What is wrong with the level of a random vibration; empty: nothing.
const char* random_misfit(const DwellRecord& r, const RandomLevel::Level& level) noexcept {
    if (r.played && r.played->word == PlayedRandom::Word::refused)
        return "the controller's PSD contradicts itself or the dwell: dwell rejected";
    if (!(std::abs(level.mean_force_g - 1) <=
          std::max(kForceTolerance, kForceSigmas * level.mean_force_sigma_g)))
        return "mean vertical specific force is not 1 g: dwell rejected";
    if (!(level.sigmas_apart <= kLevelSigmas))
        return r.played && r.played->word == PlayedRandom::Word::good
                   ? "accelerometers and the controller's PSD disagree on the level of the random "
                     "vibration: dwell rejected"
                   : "accelerometers and profile disagree on the level of the random vibration: "
                     "dwell rejected";
    return "";
}

/// What its samples are good for shows where its blocks are made: a level about a frequency that
/// does not stand is none.
DwellVerdict judge_swept(const DwellRecord& r) noexcept {
    DwellVerdict verdict;
    DwellSummary& s = verdict.summary;
    const double n = r.forces;
    double square = r.forces > 0 ? r.force_square / n : 0;
    for (const double sum : r.force_sum) square -= r.forces > 0 ? sum / n * (sum / n) : 0;
    s.kappa = 1 + std::max(0.0, square) / r.seen.share;
    s.amplitude_g = std::sqrt(2.0 * (s.kappa - 1));
    if (r.samples == 0 || r.forces == 0) {
        s.reason = r.samples == 0 ? "no samples" : "no usable specific force";
        verdict.rejected = true;
    } else if (r.saturated_axis >= 0) {
        s.reason = kSaturated[r.saturated_axis];
        verdict.rejected = true;
    } else if (r.cut_short) {
        s.reason = "a sweep that was cut short: not used";
        verdict.rejected = true;
    } else if (r.rejected > kRejectedTolerance * r.samples) {
        s.reason = "more than 1 % of the samples rejected";
    }
    s.flagged = *s.reason != '\0';
    return verdict;
}

DwellVerdict judge(const DwellRecord& r, const Settings& settings) noexcept {
    if (r.info.sweep.any()) {
        DwellVerdict verdict = judge_swept(r);
        DwellSummary& s = verdict.summary;
        s.run = r.info.run;
        s.position = r.info.position;
        s.samples = r.samples;
        s.used = verdict.rejected ? 0 : r.used;
        s.rejected = verdict.rejected ? r.samples : r.rejected;
        return verdict;
    }
    DwellVerdict verdict;
    DwellSummary& s = verdict.summary;
    s.run = r.info.run;
    s.position = r.info.position;
    s.samples = r.samples;
    s.used = r.used;
    s.rejected = r.rejected;
    s.reinitialised = r.reinitialised;
    const bool sparse = r.forces < kLeastReadings * r.slots ||
                        (r.largest_kappa > kShaken && r.crowded > kCrowdedTolerance * r.samples);
    if (r.level_samples > 0 && !sparse) {
        s.kappa = r.kappa_sum / r.level_samples;
        s.mean_force_g = r.mean_force_sum / r.level_samples;
        if (r.shape_weight > 0) {
            for (std::size_t k = 0; k < s.gamma.size(); ++k)
                s.gamma[k] = r.shape_sum[k] / r.shape_weight;
        }
    }
    s.amplitude_g = std::sqrt(2.0 * std::max(0.0, s.kappa - 1.0));
    s.frequency_hz = r.frequency_samples > 0 ? r.frequency_sum / r.frequency_samples : 0.0;
    if (s.kappa > 1) s.relative_error = r.seen.error;
    const bool random = r.info.random.mean_square_g2 > 0;
    const auto random_level = random ? take_random_level(r, settings, s) : RandomLevel::Level{};
    s.nis_per_dof = r.nis_count > 0 ? r.nis_sum / (3.0 * r.nis_count) : 0.0;
    s.innovation_correlation =
        r.innovation_square > 0 ? r.innovation_product / r.innovation_square : 0.0;

    const auto flag = [&](const char* reason, bool reject) {
        s.flagged = true;
        s.reason = reason;
        verdict.rejected = reject;
    };
    const double window_s =
        std::clamp(r.span_s, VibrationLevel::kFirstWindow_s, settings.level_window_s);
    // As measured, where that is known: the nominal one may be off.
    const double nominal_hz = r.info.frequency_hz > 0 ? r.info.frequency_hz : settings.frequency_hz;
    const double frequency_hz = s.frequency_hz > 0 ? s.frequency_hz : nominal_hz;
    const bool aliases = !random && s.kappa > 1.0 && r.period_s > 0;
    if (r.samples == 0) {
        flag("no samples", true);
    } else if (2 * r.locked > r.samples) {
        flag("the inner gimbal is beyond 80 deg: dwell rejected", true);
    } else if (r.level_samples <= 0) {
        flag(2 * r.forces > r.samples
                 ? "readings are too few or too far apart to know the vibration level: dwell "
                   "rejected"
                 : "no usable specific force",
             true);
    } else if (sparse) {
        flag("too many readings are missing to know the vibration level: dwell rejected", true);
    } else if (r.saturated_axis >= 0) {
        flag(kSaturated[r.saturated_axis], true);
    } else if (const char* misfit = random ? random_misfit(r, random_level) : ""; *misfit != '\0') {
        flag(misfit, true);
    } else if (!random && !(std::abs(s.mean_force_g - 1.0) <= kForceTolerance)) {
        flag("mean vertical specific force is not 1 g within 2 %: dwell rejected", true);
    } else if (aliases && VibrationLevel::excluded(nominal_hz, r.period_s, window_s)) {
        flag(
            "vibration.frequency_hz is too close to a multiple of half the sample rate: dwell "
            "rejected",
            true);
    } else if (aliases && VibrationLevel::excluded(frequency_hz, r.period_s, window_s)) {
        flag("the vibration is too close to a multiple of half the sample rate: dwell rejected",
             true);
    } else if (!random && r.largest_kappa > (1.0 + kLevelTolerance) * r.least_kappa) {
        // The level lags behind by its window: second-order terms would take up the difference.
        flag("the vibration level changed by more than 10 % of kappa: dwell rejected", true);
    } else if (r.info.frequency_hz > 0 && !random &&
               (s.frequency_hz > 0 ? std::abs(s.frequency_hz - nominal_hz) > kOffFrequency_hz
                                   : s.kappa > kShaken)) {
        flag("the vibration is not at its commanded frequency within 0.05 Hz: dwell rejected",
             true);
    } else if (r.stuck == 0 && r.gated > kMostGated * r.samples) {
        flag(
            "more than 12 % of the samples are beyond what the configured noise allows: dwell "
            "rejected",
            true);
    } else if (const char* alias =
                   aliases ? VibrationLevel::aliasing(frequency_hz, r.period_s, window_s) : "";
               *alias != '\0') {
        flag(alias, false);
    } else if (!random && s.kappa > kNotJudged && !(s.frequency_hz > 0)) {
        flag("the vibration is not found near vibration.frequency_hz: aliasing cannot be judged",
             false);
    } else if (r.stuck > 0) {
        flag("a resolver stood still", false);
    } else if (r.played && r.played->word == PlayedRandom::Word::not_read) {
        flag("the controller's PSD could not be read: its profile's stands in its place", false);
        s.followed = true;
    } else if (s.rejected > kRejectedTolerance * s.samples) {
        flag("more than 1 % of the samples rejected", false);
    } else if (!random && r.largest_kappa > (1.0 + kLevelDrift) * r.least_kappa &&
               r.forces > (1.0 - kMostFilled) * r.slots) {
        flag("the vibration level drifted by more than 2.5 % of kappa: followed", false);
        s.followed = true;
    }
    if (verdict.rejected) {
        s.used = 0;
        s.rejected = s.samples;
    }
    return verdict;
}

}  // namespace vibrig::estimator
