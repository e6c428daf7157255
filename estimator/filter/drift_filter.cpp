#include "estimator/filter/drift_filter.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/second_moment.hpp"

namespace vibrig::estimator {
namespace {

/// So many gated samples in a row mean that the angles, not the samples, are wrong.
constexpr int kGatedBeforeRestart = 5;
/// Longer gaps start the angles afresh: one step over them would be too coarse.
constexpr double kLongestGap_s = 1.0;

void copy_scaled(const Eigen::Matrix3d& m, double scale, double (&out)[3][3]) noexcept {
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) {
            out[r][c] = scale * m(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
        }
    }
}

}  // namespace

FilterNoise FilterNoise::of(const Settings& settings) noexcept {
    const double lsb = 1296000.0 / std::exp2(settings.resolver_bits);  // arcsec
    const double walk = 60.0 * settings.gyro_random_walk_deg_per_rt_h;
    return {settings.resolver_arcsec * settings.resolver_arcsec + lsb * lsb / 12.0, walk * walk};
}

NoiseLevels noise_levels(const Settings& settings) noexcept {
    const double n = settings.gyro_random_walk_deg_per_rt_h;
    return {std::sqrt(FilterNoise::of(settings).angle_variance), {n, n, n}};
}

FilterNoise FilterNoise::of(const NoiseLevels& levels) noexcept {
    FilterNoise noise;
    noise.angle_variance = levels.angle_arcsec * levels.angle_arcsec;
    double largest = 0;
    for (const double n : levels.gyro_random_walk_deg_per_rt_h) largest = std::max(largest, n);
    noise.walk = 3600.0 * largest * largest;
    for (std::size_t j = 0; j < kGyros; ++j) {
        noise.gyro_share[j] = largest > 0 ? levels.gyro_random_walk_deg_per_rt_h[j] / largest : 1.0;
    }
    return noise;
}

DriftFilter::DriftFilter(const Settings& settings, const ParameterArray& sigma)
    : kinematics_(settings),
      model_(settings),
      noise_(FilterNoise::of(settings)),
      gate_(settings.gate_nis),
      filter_(sigma),
      level_(kinematics_.pose(Eigen::Vector3d::Zero()).level) {}

void DriftFilter::begin_dwell() noexcept {
    started_ = false;
    gated_in_a_row_ = 0;
}

void DriftFilter::begin_dwell_after_walk(double variance) noexcept {
    static_assert(internal_index(kDt, 0) == 0 && internal_index(kDt, 2) == 2);
    if (variance > 0) filter_.let_first_move(variance);
    begin_dwell();
}

Eigen::Vector3d DriftFilter::angles() const noexcept {
    const UdFilter::Vector3 a = filter_.angles();
    return Eigen::Vector3d(a[0], a[1], a[2]) / kArcsecPerRad;
}

void DriftFilter::predict(double dt, const VibrationMoment& vibration) noexcept {
    const Pose pose = kinematics_.pose(angles());
    level_ = pose.level;
    const Eigen::Matrix3d moment = second_moment(pose, vibration);
    const Regressors h = model_.regressors(pose.up, moment);
    const Eigen::Vector3d rate = model_.platform_rate(pose, h, filter_.constants());
    const Eigen::Matrix3d jacobian = model_.jacobian(pose, moment, filter_.constants(), rate);
    const Eigen::Vector3d increment = dt * (pose.m * rate);

    UdFilter::Transition t{};
    copy_scaled(jacobian, dt / kArcsecPerRad, t.f);
    for (std::size_t k = 0; k < 3; ++k) {
        t.f[k][k] += 1.0;
        t.angle_increment[k] = increment[static_cast<Eigen::Index>(k)];
    }
    copy_scaled(pose.m, model_.drift_sign() * dt, t.g);
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) t.h[internal_index(group, j)] = h[group][j];
    }
    copy_scaled(pose.m, 1.0, t.noise_map);
    for (auto& row : t.noise_map) {
        for (std::size_t j = 0; j < kGyros; ++j) row[j] *= noise_.gyro_share[j];
    }
    t.noise = noise_.walk * dt;
    filter_.predict(t);
}

StepResult DriftFilter::step(double time_s, const Eigen::Vector3d& angles_rad,
                             const VibrationMoment& vibration) noexcept {
    StepResult result;
    UdFilter::Vector3 z{};
    // Readings without good angles leave a gap here that the caller does not see.
    if (started_ && time_s - time_s_ > kLongestGap_s) begin_dwell();
    if (!started_) {
        for (std::size_t k = 0; k < 3; ++k) {
            z[k] = wrap(angles_rad[static_cast<Eigen::Index>(k)]) * kArcsecPerRad;
        }
        filter_.start_angles(z, noise_.angle_variance);
        started_ = true;
        level_ = kinematics_.pose(angles()).level;
        time_s_ = time_s;
        gated_in_a_row_ = 0;
        result.outcome = StepOutcome::initialised;
        return result;
    }
    predict(time_s - time_s_, vibration);
    time_s_ = time_s;

    const UdFilter::Vector3 predicted = filter_.angles();
    for (std::size_t k = 0; k < 3; ++k) {
        z[k] =
            wrap_next_to(angles_rad[static_cast<Eigen::Index>(k)], predicted[k] / kArcsecPerRad) *
            kArcsecPerRad;
        result.innovation_arcsec[k] = z[k] - predicted[k];
    }
    const UdFilter::Update update = filter_.update(z, noise_.angle_variance, gate_);
    result.nis = update.nis;
    if (!update.done) {
        result.outcome = StepOutcome::gated;
        if (++gated_in_a_row_ < kGatedBeforeRestart) return result;
        filter_.start_angles(z, noise_.angle_variance);
        gated_in_a_row_ = 0;
        result.outcome = StepOutcome::reinitialised;
        return result;
    }
    gated_in_a_row_ = 0;
    result.outcome = StepOutcome::used;
    return result;
}

}  // namespace vibrig::estimator
