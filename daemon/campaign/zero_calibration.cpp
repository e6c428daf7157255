#include "daemon/campaign/zero_calibration.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/zeros/observability.hpp"
#include "estimator/zeros/simulation.hpp"
#include "estimator/zeros/together.hpp"

namespace vibrig::campaign {

namespace zeros = estimator::zeros;

namespace {

using estimator::kRadPerDeg;

constexpr double kSureness = 3;  // standard deviations
// The gimbals take the shorter way round, and of half a turn neither way is the shorter: what a
// slew ends beside its target would decide. 2 deg short of it at either end, it is decided.
const std::vector<double> kAzimuths_deg{0, 88, -88, 88};
// The inner gimbal stays well away from where its axis and the outer one's fall together with the
// azimuth's, at 90 deg.
const std::vector<double> kInner_deg{0, 60, -60, 60};

}  // namespace

std::vector<zeros::Way> ways_of(const ZeroingSettings& settings) {
    std::vector<zeros::Way> ways{{2, false}};
    if (settings.both_ways) ways.push_back({2, true});
    if (settings.second_axis) ways.insert(ways.end(), {{1, false}, {1, true}});
    return ways;
}

std::vector<Vector> slews_of(const zeros::Way& way, const RigFrame& frame) {
    std::vector<Vector> slews;
    if (way.upright == 2) {
        for (const double angle : kAzimuths_deg)
            slews.push_back(frame.azimuth_vertical_deg(angle, way.down));
    } else {
        for (const double angle : kInner_deg)
            slews.push_back(frame.inner_vertical_deg(angle, way.down));
    }
    return slews;
}

zeros::CalibrationSettings ZeroCalibration::plan(const zeros::Way& way) const {
    zeros::CalibrationSettings s;
    s.site.latitude_rad = kRadPerDeg * rig_.latitude_deg;
    s.site.gravity_mps2 = rig_.gravity_mps2;
    s.plan.targets_deg = way.upright == 2 ? kAzimuths_deg : kInner_deg;
    s.plan.rate_deg_s = settings_.slew_deg_per_s;
    s.plan.duration_s = settings_.duration_s;
    s.upright = way.upright;
    s.inverted = way.down;
    s.noise.scale_factor = settings_.scale_factor;
    s.noise.misalignment = 0;
    for (const auto& of_axes : rig_.uncertainty.accelerometer_cross)
        s.noise.misalignment = std::max(s.noise.misalignment, of_axes.u);
    s.noise.velocity_reference = settings_.velocity_reference_mps;
    s.noise.position_reference = settings_.position_reference_m;
    s.noise.reference_is_bound = true;
    s.noise.angle_random_walk =
        std::max(settings_.angle_random_walk, rig_.gyro_random_walk_deg_per_rt_h);
    // The noise of one sample as a density.
    s.noise.velocity_random_walk = std::max(2e-5, rig_.accelerometer_g * std::sqrt(sample_s_));
    // All the drift that the gyros may have is a bias here.
    s.initial.gyro_bias_deg_h = std::hypot(rig_.prior_bias, rig_.prior_linear);
    s.target_mg = settings_.target_mg;
    return s;
}

ZeroCalibration::ZeroCalibration(const ZeroingSettings& settings, const estimator::Settings& rig,
                                 double sample_s)
    : settings_(settings), rig_(rig), sample_s_(sample_s), frame_(rig), ways_(ways_of(settings)) {
    for (const zeros::Way& way : ways_) {
        static_cast<void>(slews_of(way, frame_));
        const auto s = plan(way);
        zeros::check_observable(s.plan, s.site);
    }
}

std::string ZeroCalibration::refusal() const {
    const auto s = plan();
    const double sweep_s = s.plan.sweep_s();
    if (sweep_s > settings_.duration_s) {
        return fmt::format(
            "zeroing.duration_s: found {:g}, expected more than {:g}, one sweep there and back "
            "with "
            "zeroing.slew_deg_per_s = {:g}",
            settings_.duration_s, sweep_s, settings_.slew_deg_per_s);
    }
    // The best that can be: a unit that stands still, with nothing to find.
    auto still = s;
    still.noise.velocity_reference = still.noise.position_reference = 1e-9;
    constexpr double kPeriod_s = 0.05;
    zeros::UnitErrors errors;
    errors.zero_mg = errors.gyro_bias_deg_h = {};
    errors.tilt_east_deg = errors.tilt_north_deg = errors.azimuth_deg = 0;
    zeros::UnitSimulation unit(still, errors, kPeriod_s, 1);
    zeros::Calibration run(s);
    double time_s = 0;
    const auto go_on = [&](double until_s) {
        while (time_s < until_s && run.add(unit.next())) time_s += kPeriod_s;
        return run.result();
    };
    const auto result = go_on(settings_.duration_s);
    if (result.valid) return {};
    std::size_t i = 0;
    while (i < 3 && result.axis[i].converged_s) ++i;
    if (i == 3 || run.given_up()) {
        return "zeroing: cannot work even with a simulated unit: " + result.problems.front();
    }
    const double got = std::max(result.axis[i].filter_sigma_mg, result.axis[i].movement_mg);
    const auto found = [&] {
        return fmt::format("{} comes to {:.3g} mg at best in {:g} s", "xyz"[i], got,
                           settings_.duration_s);
    };
    while (time_s < settings_.duration_s + 2 * sweep_s) {
        if (!go_on(time_s + 1).valid) continue;
        return fmt::format(
            "zeroing.duration_s: found {:g}, expected at least {:.0f} with zeroing.target_mg; {}",
            settings_.duration_s, std::ceil(time_s), found());
    }
    return fmt::format("zeroing.target_mg: found {:g} for {}, expected more than it can reach; {}",
                       s.target_mg[i], "xyz"[i], found());
}

void ZeroCalibration::begin() {
    results_.clear();
    way_ = 0;
    start_run();
}

void ZeroCalibration::begin_other_way() {
    results_.push_back(calibration_->result());
    ++way_;
    start_run();
}

void ZeroCalibration::start_run() {
    slews_ = slews_of(ways_[way_], frame_);
    target_ = 0;
    level_deg_.reset();
    first_time_ = last_time_ = 0;
    failure_.clear();
    calibration_.emplace(plan(ways_[way_]));
    present_.running = true;
}

Vector ZeroCalibration::target_deg() const {
    const std::size_t n = slews_.size();
    const std::size_t k = target_ < n ? target_ : n - 2 + (target_ - n) % 2;
    if (!level_deg_) return slews_[k];
    const std::size_t turning = ways_[way_].upright == 2 ? 2 : 1;
    Vector target = *level_deg_;
    target[turning] = slews_[k][turning];
    return target;
}

void ZeroCalibration::levelled_at(const Vector& encoder_rad) {
    level_deg_.emplace();
    for (std::size_t i = 0; i < 3; ++i) (*level_deg_)[i] = encoder_rad[i] / kRadPerDeg;
}

void ZeroCalibration::add(const rt::Motion& motion) {
    if (first_time_ == 0) first_time_ = motion.time;
    const double dt = last_time_ == 0 ? 0 : drivers::to_seconds(motion.time - last_time_);
    last_time_ = motion.time;
    zeros::Increment in;
    in.time_s = drivers::to_seconds(motion.time);
    in.turn_rad = motion.turn;
    in.velocity_mps = frame_.force(motion.force, rig_.gravity_mps2 * dt);
    in.azimuth_rad = frame_.azimuth(motion.angle, ways_[way_].upright);
    if (!motion.good) in.turn_rad[0] = std::nan("");
    static_cast<void>(calibration_->add(in));
}

bool ZeroCalibration::over() const {
    return calibration_->given_up() || time_s() >= settings_.duration_s;
}

double ZeroCalibration::time_s() const { return drivers::to_seconds(last_time_ - first_time_); }

std::string ZeroCalibration::finish(bool at_end) {
    results_.push_back(calibration_->result());
    present_.running = false;
    for (const zeros::CalibrationResult& run : results_) {
        if (run.valid) continue;
        for (const auto& problem : run.problems)
            failure_ += (failure_.empty() ? "" : "; ") + problem;
        return failure_;
    }
    Found found;
    ZeroStatus now;
    const auto apart = zeros::together(results_);
    const bool several = results_.size() > 1;
    found.zero_mg = apart.zero_mg;
    now.covariance_mg2 = apart.covariance_mg2;
    for (std::size_t i = 0; i < 3; ++i) {
        now.sigma_mg[i] = std::sqrt(apart.covariance_mg2[i][i]);
        // What one run does not tell apart is the same at the end.
        found.filter_sigma_mg[i] = several ? now.sigma_mg[i] : results_[0].axis[i].filter_sigma_mg;
    }
    if (several) {
        now.misalignment = {apart.share[0][2], apart.share[1][2]};
        now.misalignment_sigma = {apart.share_sigma[0][2], apart.share_sigma[1][2]};
        now.scale_z = apart.share[2][2];
        now.scale_z_sigma = apart.share_sigma[2][2];
    }
    now.zero_mg = found.zero_mg;
    now.known = true;
    last_ = now;
    now.mark = present_.mark;
    if (at_end && first_) {
        now.repeated = true;
        for (std::size_t i = 0; i < 3; ++i) {
            now.change_mg[i] = found.zero_mg[i] - first_->zero_mg[i];
            now.change_sigma_mg[i] =
                std::hypot(found.filter_sigma_mg[i], first_->filter_sigma_mg[i]);
            if (std::abs(now.change_mg[i]) > kSureness * now.change_sigma_mg[i]) {
                now.mark += fmt::format(
                    "{}zero of accelerometer {} moved by {:+.4f} mg during the campaign, expected "
                    "less than {:.4f} mg (3 standard deviations)",
                    now.mark.empty() ? "" : "; ", "xyz"[i], now.change_mg[i],
                    kSureness * now.change_sigma_mg[i]);
            }
        }
        // What was in force during the dwells stays on show.
        now.zero_mg = present_.zero_mg;
        now.sigma_mg = present_.sigma_mg;
        now.covariance_mg2 = present_.covariance_mg2;
    } else if (!at_end) {
        first_ = found;
    }
    present_ = now;
    return {};
}

std::string ZeroCalibration::words() const {
    std::string text = fmt::format("zeros after {:.0f} s:", time_s());
    for (std::size_t i = 0; i < 3; ++i) {
        text += fmt::format("{} {} {:+.4f} mg (sigma {:.4f})", i == 0 ? "" : ",", "xyz"[i],
                            last_.zero_mg[i], last_.sigma_mg[i]);
    }
    if (results_.size() > 1) {
        text += fmt::format(
            "; apart from them: misalignment {:+.1f} and {:+.1f} arcsec, scale of z {:+.1f} ppm",
            last_.misalignment[0] / estimator::kRadPerArcsec,
            last_.misalignment[1] / estimator::kRadPerArcsec, 1e6 * last_.scale_z);
    } else {
        text += "; x and y: zero + 1 g x misalignment; z: zero + 1 g x scale error";
    }
    for (const auto& run : results_)
        for (const auto& note : run.notes) text += "; " + note;
    return text;
}

Vector ZeroCalibration::raw_zero_g() const {
    if (!present_.known) return {};
    Vector zero{};
    for (std::size_t i = 0; i < 3; ++i) zero[i] = 1e-3 * present_.zero_mg[i];
    return frame_.to_raw(zero);
}

double ZeroCalibration::level_sigma(const Vector& encoder_deg) const {
    if (!present_.known) return 0;
    const Vector up = frame_.up_at_deg(encoder_deg);
    return 1e-3 * std::sqrt(std::max(0.0, quadratic(present_.covariance_mg2, up)));
}

void ZeroCalibration::fill(ZeroStatus& status) const {
    status = present_;
    status.time_s = time_s();
    status.message = failure_;
    if (present_.running && calibration_) {
        const auto& trace = calibration_->trace();
        if (!trace.empty() && !present_.known && ways_[way_].upright == 2) {
            status.zero_mg = trace.back().zero_mg;
            status.sigma_mg = trace.back().sigma_mg;
        }
    }
}

}  // namespace vibrig::campaign
