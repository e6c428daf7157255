#include "estimator/zeros/calibration.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/zeros/azimuth_gain.hpp"
#include "estimator/zeros/observability.hpp"
#include "estimator/zeros/units.hpp"
#include "estimator/zeros/zero_filter.hpp"

namespace vibrig::estimator::zeros {
namespace {

constexpr double kLongestGap_s = 0.5;
constexpr std::size_t kGapsAllowed = 3;
constexpr double kNoMotion_s = 60;
constexpr double kRateTolerance = 0.1;
constexpr double kSlowest_deg_s = 0.1;  // below it the read-out's noise hides the rate
constexpr double kLargestZero_mg = 10;
constexpr double kNearTwoG_mg = 200;  // so far the filter may be from 2 g when it is sure enough
constexpr std::size_t kBlock = 60;
constexpr double kLargestGain = 0.02;  // of a gyro; beyond it is another fault

/// Inside, axes are in the order level, level, upright.
Triple in_order(int upright, const Triple& platform) {
    Triple turned{};
    for (std::size_t i = 0; i < 3; ++i) turned[i] = platform[platform_axis(upright, i)];
    return turned;
}

/// Wilson and Hilferty; z in standard deviations.
double chi_square(double freedom, double z) {
    const double k = 2 / (9 * freedom);
    return freedom * std::pow(1 - k + z * std::sqrt(k), 3);
}

void check_settings(const CalibrationSettings& s) {
    const auto require = [](bool good, const char* name, double value, const char* expected) {
        if (!good) throw ZeroError(text("%s: %g, expected %s", name, value, expected));
    };
    s.plan.check();
    require(s.upright >= 0 && s.upright < 3, "upright axis", s.upright, "0 (x), 1 (y) or 2 (z)");
    require(std::abs(s.site.latitude_rad) < 89 * kRadPerDeg, "latitude",
            s.site.latitude_rad / kRadPerDeg, "degrees, -89 to 89");
    require(s.site.gravity_mps2 > 0 && std::isfinite(s.site.gravity_mps2), "gravity",
            s.site.gravity_mps2, "m/s^2, more than 0");
    require(s.update_s > 0 && s.update_s <= 10, "update interval", s.update_s,
            "s, more than 0, at most 10");
    const Noise& n = s.noise;
    for (const auto& [name, value] :
         {std::pair{"velocity reference noise", n.velocity_reference},
          std::pair{"position reference noise", n.position_reference}}) {
        require(value > 0 && std::isfinite(value), name, value, "more than 0");
    }
    for (const auto& [name, value] : {std::pair{"angle random walk", n.angle_random_walk},
                                      std::pair{"velocity random walk", n.velocity_random_walk},
                                      std::pair{"gyro drift", n.gyro_drift},
                                      std::pair{"accelerometer drift", n.accelerometer_drift},
                                      std::pair{"scale factor uncertainty", n.scale_factor},
                                      std::pair{"misalignment", n.misalignment}}) {
        require(value >= 0 && std::isfinite(value), name, value, "0 or more");
    }
    for (const double value : s.lever_arm_m) {
        require(std::abs(value) <= 10, "lever arm", value, "m, at most 10");
    }
    for (const double value : s.target_mg) {
        require(value > 0 && std::isfinite(value), "target", value, "mg, more than 0");
    }
    for (const auto& [name, value] : {std::pair{"saturation", s.saturation_g},
                                      std::pair{"vibration limit", s.vibration_limit_g}}) {
        require(value > 0 && std::isfinite(value), name, value, "g, more than 0");
    }
    if (!s.allow_unobservable) check_observable(s.plan, s.site);
}

}  // namespace

struct Calibration::Impl {
    explicit Impl(const CalibrationSettings& s) : settings(s) {
        settings.lever_arm_m = in_order(s.upright, s.lever_arm_m);
        const Observability seen = observability(s.plan.segments_deg(), s.site);
        for (std::size_t i = 0; i < 3; ++i)
            observable[i] = seen.degree[static_cast<std::size_t>(kAccelerometer) + i] > 0;
    }

    CalibrationSettings settings;
    std::optional<ZeroFilter> filter;
    std::array<bool, 3> observable{true, true, true};  ///< from tilt, by the plan
    std::vector<CalibrationTrace> trace;
    std::array<std::optional<double>, 3> converged_s;
    std::array<double, 3> movement{};
    InnovationStatistic innovation;
    std::vector<std::string> problems, notes;
    bool given_up = false;

    double begin_s = 0, last_s = 0, period_s = 0, update_at_s = 0;
    Eigen::Vector3d last_turn = Eigen::Vector3d::Zero(), last_velocity = Eigen::Vector3d::Zero();
    std::size_t samples = 0, updates = 0, gaps = 0;

    // within the update interval
    double turned_rad = 0, interval_s = 0, azimuth_rad = 0, azimuth_before = 0;
    bool has_azimuth = false;
    std::optional<AzimuthGain> gain;  ///< while there is a read-out
    double turned_in_all_rad = 0, gain_turned_rad = 0;
    std::size_t count = 0;
    Eigen::Vector3d force_sum = Eigen::Vector3d::Zero(), force_squares = Eigen::Vector3d::Zero();
    double rate_before = 0, still_since_s = 0;
    int off_rate = 0, shaken = 0;

    Eigen::Vector3d reference_velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d reference_position = Eigen::Vector3d::Zero();

    // innovations of the current block
    double nis_sum = 0;
    Eigen::Matrix<double, 6, 1> ratio_sum = Eigen::Matrix<double, 6, 1>::Zero();
    std::size_t in_block = 0;

    [[nodiscard]] char name(std::size_t place) const {
        return "xyz"[platform_axis(settings.upright, place)];
    }
    [[nodiscard]] double to_mg() const { return 1e3 / settings.site.gravity_mps2; }

    bool give_up(std::string why) {
        problems.push_back(std::move(why));
        given_up = true;
        return false;
    }

    void begin(const Increment& in) {
        has_azimuth = std::isfinite(in.azimuth_rad);
        const double azimuth =
            has_azimuth ? in.azimuth_rad : settings.plan.targets_deg.front() * kRadPerDeg;
        filter.emplace(settings, azimuth + settings.heading_deg * kRadPerDeg);
        azimuth_rad = azimuth_before = azimuth;
        if (has_azimuth) gain.emplace(settings.initial.gyro_bias_deg_h * kDegPerHour);
        begin_s = last_s = still_since_s = in.time_s;
        update_at_s = begin_s + settings.update_s;
        samples = 1;
    }

    /// What is wrong with a sample; empty if nothing.
    [[nodiscard]] std::string fault_of(const Increment& in, double dt) const {
        for (std::size_t i = 0; i < 3; ++i) {
            if (!std::isfinite(in.turn_rad[i])) {
                return text("gyro %c is not a number at %.3f s", name(i), in.time_s);
            }
            if (!std::isfinite(in.velocity_mps[i])) {
                return text("accelerometer %c is not a number at %.3f s", name(i), in.time_s);
            }
            if (period_s > 0 && std::abs(in.velocity_mps[i]) >=
                                    settings.saturation_g * settings.site.gravity_mps2 * dt) {
                return text("accelerometer %c saturated (%.4g g) at %.3f s", name(i),
                            in.velocity_mps[i] / dt / settings.site.gravity_mps2, in.time_s);
            }
        }
        return "";
    }

    /// Bridges time without data with the last motion, and trusts the attitude less for it.
    bool bridge(double gap_s, const std::string& why) {
        if (gap_s > 1.5 * period_s || !why.empty()) {
            const double part = period_s > 0 ? gap_s / period_s : 1;
            filter->advance(last_turn * part, last_velocity * part, gap_s);
            const double turn = settings.plan.rate_deg_s * kRadPerDeg * gap_s;
            turned_in_all_rad += (settings.inverted ? -1 : 1) * last_turn[2] * part;
            if (gain) gain->loosen(turn);
            if (gap_s > kLongestGap_s) {
                filter->loosen(settings.initial.tilt_deg * kRadPerDeg + turn,
                               settings.initial.velocity_mps, settings.initial.position_m);
            } else {
                filter->loosen(turn, 0.01 * settings.site.gravity_mps2 * gap_s, 0);
            }
        }
        if (why.empty() && gap_s <= kLongestGap_s) {
            return true;
        }
        ++gaps;
        const std::string found =
            why.empty() ? text("no increments for %.3g s until %.3f s", gap_s, last_s + gap_s)
                        : why;
        if (gaps > kGapsAllowed) {
            return give_up(
                text("given up: more than %zu gaps; the last: %s", kGapsAllowed, found.c_str()));
        }
        notes.push_back(found);
        return true;
    }

    bool watch_motion(double now_s) {
        const double moved =
            has_azimuth ? std::remainder(azimuth_rad - azimuth_before, 2 * kPi) : turned_rad;
        const double rate = moved / interval_s / kRadPerDeg;
        azimuth_before = azimuth_rad;
        const double planned = settings.plan.rate_deg_s;
        if (!settings.plan.turns() || planned < kSlowest_deg_s) return true;
        if (std::abs(rate) > 0.2 * planned) still_since_s = now_s;
        if (now_s - still_since_s >= kNoMotion_s) {
            return give_up(
                text("azimuth has not turned for %.0f s: x and y zeros cannot be told from tilt "
                     "(rank 12 of 15)",
                     now_s - still_since_s));
        }
        const bool steady =
            std::abs(rate) > 0.2 * planned && std::abs(rate - rate_before) < 0.05 * std::abs(rate);
        off_rate = steady && std::abs(std::abs(rate) - planned) > kRateTolerance * planned
                       ? off_rate + 1
                       : 0;
        rate_before = rate;
        if (off_rate >= 3) {
            return give_up(
                text("azimuth turns at %.4g deg/s at %.3f s, commanded %.4g deg/s: more "
                     "than 10 %% off",
                     std::abs(rate), now_s, planned));
        }
        return true;
    }

    bool watch_vibration(double now_s) {
        const double n = static_cast<double>(count);
        if (count < 2) return true;
        const Eigen::Vector3d mean = force_sum / n;
        const Eigen::Vector3d variance = force_squares / n - mean.cwiseAbs2();
        Eigen::Index worst = 0;
        const double level =
            std::sqrt(std::max(0.0, variance.maxCoeff(&worst))) / settings.site.gravity_mps2;
        // The start of a slew shakes once, on the border of two intervals; a shaker goes on.
        shaken = level > settings.vibration_limit_g ? shaken + 1 : 0;
        if (shaken < 3) return true;
        return give_up(
            text("shaker must be off during zero calibration: vibration of %.3g g (1 "
                 "sigma) on %c at %.3f s, limit %.3g g",
                 level, name(static_cast<std::size_t>(worst)), now_s, settings.vibration_limit_g));
    }

    [[nodiscard]] static bool outside(const InnovationStatistic& v) {
        return v.mean_nis > v.high || v.mean_nis < v.low;
    }

    void account(const ZeroFilter::Innovation& found) {
        nis_sum += found.nis;
        ratio_sum += found.ratio;
        if (++in_block < kBlock) return;
        const double n = static_cast<double>(kBlock);
        constexpr double k999 = 3.2905;
        innovation.mean_nis = nis_sum / n;
        innovation.low = settings.noise.reference_is_bound ? 0 : chi_square(6 * n, -k999) / n;
        innovation.high = chi_square(6 * n, k999) / n;
        ++innovation.blocks;
        if (outside(innovation)) ++innovation.outside;
        for (std::size_t i = 0; i < 3; ++i) {
            innovation.velocity_ratio[i] = ratio_sum[static_cast<Eigen::Index>(i)] / n;
            innovation.position_ratio[i] = ratio_sum[static_cast<Eigen::Index>(i + 3)] / n;
        }
        nis_sum = 0;
        ratio_sum.setZero();
        in_block = 0;
    }

    /// What a wrong gain of the vertical gyro has made of the azimuth is taken off it. The gain
    /// comes from whole sweeps, so that a read-out that is late by some samples does no harm.
    void correct_azimuth(double now_s) {
        if (!gain) return;
        turned_in_all_rad += turned_rad;
        const double time_s = now_s - begin_s;
        const double sign = settings.inverted ? -1 : 1;
        gain->add({time_s, turned_in_all_rad - earth_rate(settings.site)[2] * time_s, azimuth_rad,
                   sign * last_turn[2] / period_s});
        const double off = gain->value() * gain->read_rad();
        filter->turn_back(off - gain_turned_rad);
        gain_turned_rad = off;
    }

    bool update(double now_s) {
        correct_azimuth(now_s);
        if (!watch_motion(now_s) || !watch_vibration(now_s)) return false;
        account(filter->update(reference_velocity, reference_position));
        ++updates;
        CalibrationTrace point{now_s - begin_s, {}, {}};
        for (std::size_t i = 0; i < 3; ++i) {
            const auto k = static_cast<Eigen::Index>(i);
            point.zero_mg[i] = filter->zero()[k] * to_mg();
            point.sigma_mg[i] =
                std::sqrt(filter->covariance()(kAccelerometer + k, kAccelerometer + k)) * to_mg();
        }
        trace.push_back(point);
        watch_convergence(point);
        for (std::size_t i = 0; i < 3; ++i) {
            if (point.sigma_mg[i] < 1 && std::abs(point.zero_mg[i]) > kLargestZero_mg) {
                if (i == 2 && stands_on_its_head(point.zero_mg[i])) {
                    const bool down = settings.inverted;
                    return give_up(
                        text("zero of accelerometer %c is %.4g mg, about 2 g: the unit stands "
                             "with %c %s, expected %s (the wrong file, or --inverted of `vibrig "
                             "zero` %s)",
                             name(i), point.zero_mg[i], name(i), down ? "up" : "down",
                             down ? "down" : "up", down ? "is too much" : "is missing"));
                }
                if (i == 2 && std::abs(point.zero_mg[i]) > kNearTwoG_mg)
                    return give_up(
                        text("zero of accelerometer %c is %.4g mg, outside the small-error range "
                             "of %.0f mg: it shows about %.2g g, expected 1 g: the unit of "
                             "velocities or times, increments that are missing, or %c is not %s",
                             name(i), point.zero_mg[i], kLargestZero_mg,
                             1 + (settings.inverted ? -1e-3 : 1e-3) * point.zero_mg[i], name(i),
                             settings.inverted ? "down" : "up"));
                // Turned by a wrong azimuth, gravity's tilt looks like zeros.
                const std::string off = azimuth_off();
                return give_up(
                    text("zero of accelerometer %c is %.4g mg, outside the small-error range of "
                         "%.0f mg: %s",
                         name(i), point.zero_mg[i], kLargestZero_mg,
                         off.empty() ? "level first" : off.c_str()));
            }
        }
        interval_s = turned_rad = 0;
        count = 0;
        force_sum.setZero();
        force_squares.setZero();
        return true;
    }

    /// Empty: the vertical gyro and the read-out turn alike.
    [[nodiscard]] std::string azimuth_off() const {
        if (!gain || !(std::abs(gain->value()) > kLargestGain)) return {};
        return text(
            "the vertical gyro turns by %.4g times the azimuth read-out, expected 1 within %.0f "
            "%%: sign, axes or unit of the increments or of the read-out",
            1 + gain->value(), 100 * kLargestGain);
    }

    /// Gravity with the wrong sign looks like a zero of 2 g.
    [[nodiscard]] bool stands_on_its_head(double zero_mg) const {
        return std::abs(zero_mg - (settings.inverted ? 2000 : -2000)) < kNearTwoG_mg;
    }

    void watch_convergence(const CalibrationTrace& now) {
        const double sweep = settings.plan.sweep_s();
        const auto first = std::partition_point(
            trace.begin(), trace.end(),
            [&](const CalibrationTrace& p) { return p.time_s < now.time_s - sweep - 1e-9; });
        const bool whole = now.time_s >= sweep - 1e-9 || sweep >= settings.plan.duration_s;
        for (std::size_t i = 0; i < 3; ++i) {
            const auto [low, high] = std::minmax_element(
                first, trace.end(),
                [&](const auto& a, const auto& b) { return a.zero_mg[i] < b.zero_mg[i]; });
            movement[i] = high->zero_mg[i] - low->zero_mg[i];
            const bool good = whole && now.sigma_mg[i] < settings.target_mg[i] &&
                              movement[i] < settings.target_mg[i];
            if (!good) {
                converged_s[i].reset();
            } else if (!converged_s[i]) {
                converged_s[i] = now.time_s;
            }
        }
    }

    bool add(const Increment& in) {
        if (given_up) return false;
        if (!std::isfinite(in.time_s)) {
            return give_up(text("time of increment %zu is not a number", samples + 1));
        }
        if (!filter) {
            begin(in);
            return true;
        }
        const double dt = in.time_s - last_s;
        if (!(dt > 0)) {
            return give_up(
                text("time goes from %.6f s to %.6f s, expected it to grow", last_s, in.time_s));
        }
        const std::string fault = fault_of(in, period_s > 0 ? period_s : dt);
        if (!fault.empty()) {
            if (!bridge(dt, fault)) return false;
        } else {
            if (period_s == 0) period_s = dt;
            const double gap = dt - period_s;
            const bool whole = gap <= 0.5 * period_s;
            if (!whole && !bridge(gap, "")) return false;
            const double step = whole ? dt : period_s;
            last_turn = vector(in.turn_rad);
            last_velocity = vector(in.velocity_mps);
            filter->advance(last_turn, last_velocity, step);
            const Eigen::Vector3d force = last_velocity / step;
            force_sum += force;
            force_squares += force.cwiseAbs2();
            turned_rad += (settings.inverted ? -1 : 1) * last_turn[2];
            ++count;
        }
        if (std::isfinite(in.azimuth_rad)) azimuth_rad = in.azimuth_rad;
        reference_velocity = vector(in.reference_velocity_mps);
        reference_position = vector(in.reference_position_m);
        interval_s += dt;
        last_s = in.time_s;
        ++samples;
        if (in.time_s >= update_at_s - 0.25 * period_s) {
            update_at_s += settings.update_s;
            if (update_at_s <= in.time_s) update_at_s = in.time_s + settings.update_s;
            return update(in.time_s);
        }
        return true;
    }

    void judge(CalibrationResult& r) const {
        r.problems = problems;
        if (updates == 0) {
            r.problems.emplace_back("no increments: nothing to calibrate with");
            return;
        }
        for (std::size_t i = 0; !given_up && i < 3; ++i) {
            if (r.axis[i].converged_s) continue;
            const double sigma_mg = r.axis[i].filter_sigma_mg;
            r.problems.push_back(text(
                "%c has not converged after %.0f s: standard deviation %.3g mg, moved %.3g mg "
                "within the last sweep, target %.3g mg; %s",
                name(i), r.time_s, sigma_mg, r.axis[i].movement_mg, settings.target_mg[i],
                sigma_mg >= settings.target_mg[i]
                    ? "lengthen the run by more sweeps"
                    : "lengthen the run until a whole sweep has passed, and wait for the unit to "
                      "be warm"));
        }
        if (const auto off = azimuth_off(); !given_up && !off.empty()) r.problems.push_back(off);
        const InnovationStatistic& v = innovation;
        const bool last_outside = v.blocks > 0 && outside(v);
        if (!last_outside && v.outside < 2) return;
        const bool large = v.mean_nis > 6;
        double worst = 0;
        std::string row;
        for (std::size_t i = 0; i < 3; ++i) {
            constexpr std::array kDirections{"east", "north", "up"};
            for (const auto& [name, ratio] : {std::pair{"velocity", v.velocity_ratio[i]},
                                              std::pair{"position", v.position_ratio[i]}}) {
                const double off = large ? ratio : 1 / std::max(ratio, 1e-12);
                if (off > worst) {
                    worst = off;
                    row = text("%s %s, squares %.3g of what is expected", name, kDirections[i],
                               ratio);
                }
            }
        }
        r.problems.push_back(
            text("innovations not consistent: mean of 60 normalised squares %.3g, "
                 "expected %.3g to %.3g (%zu of %zu blocks outside); most: %s",
                 v.mean_nis, v.low, v.high, v.outside, v.blocks, row.c_str()));
    }

    /// What the filter knows, before what is not observable is added.
    [[nodiscard]] Joint joint() const {
        Eigen::Matrix<double, Joint::kSize, 1> unit;
        std::array<Eigen::Index, Joint::kSize> state{};
        Joint r;
        for (std::size_t k = 0; k < Joint::kSize; ++k) {
            const auto i = static_cast<Eigen::Index>(k);
            const bool zero = k < 3;
            state[k] = zero ? kAccelerometer + i : kCross + i - 3;
            unit[i] = zero ? to_mg() : 1e3;  // inside m/s^2, and 1 of 1 g
            r.prior[k] = zero ? settings.initial.zero_mg
                              : 1e3 * cross_prior(settings, (k - 3) / 2, (k - 3) % 2);
            r.value[k] =
                unit[i] * (zero ? filter->zero()[i] : filter->cross()((i - 3) / 2, (i - 3) % 2));
        }
        for (std::size_t i = 0; i < Joint::kSize; ++i) {
            for (std::size_t j = 0; j < Joint::kSize; ++j)
                r.covariance[i][j] = filter->covariance()(state[i], state[j]) *
                                     unit[static_cast<Eigen::Index>(i)] *
                                     unit[static_cast<Eigen::Index>(j)];
        }
        return r;
    }

    [[nodiscard]] CalibrationResult result() const {
        CalibrationResult r;
        r.innovation = innovation;
        r.updates = updates;
        r.gaps = gaps;
        r.notes = notes;
        r.time_s = last_s - begin_s;
        if (gain) r.gyro_gain = gain->value();
        const Noise& noise = settings.noise;
        const Triple share_mg{1e3 * noise.misalignment, 1e3 * noise.misalignment,
                              1e3 * noise.scale_factor};
        if (filter) {
            r.joint = joint();
            for (std::size_t i = 0; i < 3; ++i) {
                const auto k = static_cast<Eigen::Index>(i);
                AxisResult& axis = r.axis[i];
                axis.zero_mg = r.joint.value[i];
                if (!observable[i]) {
                    // Not separable from tilt: as unsure as before, and by what the filter makes of
                    // it.
                    r.joint.covariance[i][i] = settings.initial.zero_mg * settings.initial.zero_mg +
                                               axis.zero_mg * axis.zero_mg;
                }
                for (std::size_t j = 0; j < 3; ++j)
                    r.covariance_mg2[i][j] = r.joint.covariance[i][j];
                axis.filter_sigma_mg = std::sqrt(r.covariance_mg2[i][i]);
                r.filter_covariance_mg2[i] = r.covariance_mg2[i];
                // Each accelerometer shows what it sees of 1 g along the axis of the slews too.
                r.covariance_mg2[i][i] += share_mg[i] * share_mg[i];
                axis.sigma_mg = std::sqrt(r.covariance_mg2[i][i]);
                axis.movement_mg = movement[i];
                axis.converged_s = converged_s[i];
                r.gyro_bias_deg_h[i] = filter->gyro_bias()[k] / kDegPerHour;
                r.gyro_sigma_deg_h[i] =
                    std::sqrt(filter->covariance()(kGyro + k, kGyro + k)) / kDegPerHour;
            }
        }
        judge(r);
        r.valid = r.problems.empty();
        return r;
    }
};

Calibration::Calibration(const CalibrationSettings& settings)
    : impl_((check_settings(settings), std::make_unique<Impl>(settings))) {}
Calibration::~Calibration() = default;
Calibration::Calibration(Calibration&&) noexcept = default;
Calibration& Calibration::operator=(Calibration&&) noexcept = default;

bool Calibration::add(const Increment& increment) {
    const int upright = impl_->settings.upright;
    if (upright == 2) return impl_->add(increment);
    Increment turned = increment;
    turned.turn_rad = in_order(upright, increment.turn_rad);
    turned.velocity_mps = in_order(upright, increment.velocity_mps);
    return impl_->add(turned);
}
bool Calibration::given_up() const noexcept { return impl_->given_up; }
CalibrationResult Calibration::result() const {
    const CalibrationResult found = impl_->result();
    CalibrationResult r = found;
    r.upright = impl_->settings.upright;
    r.inverted = impl_->settings.inverted;
    for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t to = platform_axis(r.upright, i);
        r.axis[to] = found.axis[i];
        r.gyro_bias_deg_h[to] = found.gyro_bias_deg_h[i];
        r.gyro_sigma_deg_h[to] = found.gyro_sigma_deg_h[i];
        for (std::size_t j = 0; j < 3; ++j) {
            const std::size_t and_to = platform_axis(r.upright, j);
            r.covariance_mg2[to][and_to] = found.covariance_mg2[i][j];
            r.filter_covariance_mg2[to][and_to] = found.filter_covariance_mg2[i][j];
        }
    }
    return r;
}
const std::vector<CalibrationTrace>& Calibration::trace() const noexcept { return impl_->trace; }

}  // namespace vibrig::estimator::zeros
