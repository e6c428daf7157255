#include "estimator/batch_solver.hpp"

#include <Eigen/Cholesky>

#include "estimator/linear_algebra.hpp"
#include "estimator/second_moment.hpp"

namespace vibrig::estimator {
namespace {

/// A ramp's unit is the change over so long; its zero, which is free, half way.
constexpr double kRamp_s = 100.0, kRampCentre_s = 50.0;

}  // namespace

BatchSolver::BatchSolver(const Settings& settings, const ParameterArray& prior)
    : kinematics_(settings), model_(settings), noise_(FilterNoise::of(settings)), prior_(prior) {
    block_.setZero();
}

void BatchSolver::begin_dwell() noexcept {
    started_ = false;
    in_block_ = 0;
    readings_ = 0;
    of_dwell_.setZero();
}

void BatchSolver::start(double time_s, const Eigen::Vector3d& angles_rad) noexcept {
    path_ = angles_rad;
    time_s_ = time_s;
    if (readings_ == 0) {
        first_s_ = last_s_ = time_s;
        first_path_ = angles_rad;
        path_sum_.setZero();
    }
    difference_.setZero();
    walked_ = noise_.angle_variance * Eigen::Matrix3d::Identity();
    started_ = true;
}

void BatchSolver::step(double time_s, const Eigen::Vector3d& angles_rad,
                       const VibrationMoment& vibration, bool used) noexcept {
    if (!started_) return;
    const double dt = time_s - time_s_;
    time_s_ = time_s;
    const Pose pose = kinematics_.pose(path_);
    const Regressors h = model_.regressors(pose.up, second_moment(pose, vibration));
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            difference_.col(static_cast<Eigen::Index>(internal_index(group, j))) +=
                model_.drift_sign() * dt * h[group][j] * pose.m.col(static_cast<Eigen::Index>(j));
        }
    }
    const double of_ramp = model_.drift_sign() * dt * (time_s - first_s_ - kRampCentre_s) / kRamp_s;
    for (Eigen::Index j = 0; j < 3; ++j) difference_.col(kRamps + j) += of_ramp * pose.m.col(j);
    auto angles = difference_.col(kColumns - 1);
    angles += dt * (pose.m * pose.earth_rate);
    const Eigen::Map<const Eigen::Vector3d> share(noise_.gyro_share.data());
    const Eigen::Matrix3d walking = pose.m * share.asDiagonal();
    walked_ += noise_.walk * dt * (walking * walking.transpose());
    if (!used) return;

    for (Eigen::Index k = 0; k < 3; ++k) {
        const double reading = wrap_next_to(angles_rad[k], path_[k]);
        angles[k] += (reading - path_[k]) * kArcsecPerRad;
        path_[k] = reading;
        path_sum_[k] += reading - first_path_[k];
    }
    last_s_ = time_s;
    ++readings_;
    // Local level: S = P + R, what is left after the reading is R S^-1 of what was before.
    const Eigen::Matrix3d s = walked_ + noise_.angle_variance * Eigen::Matrix3d::Identity();
    const Eigen::LLT<Eigen::Matrix3d> cholesky(s);
    block_.middleRows<3>(3 * in_block_) = cholesky.matrixL().solve(difference_);
    const Eigen::Matrix3d left =
        noise_.angle_variance * cholesky.solve(Eigen::Matrix3d::Identity());
    difference_ = (left * difference_).eval();
    walked_ = (left * walked_).eval();
    if (++in_block_ == kReadingsPerBlock) add_block();
}

void BatchSolver::add_block() noexcept {
    of_dwell_.noalias() += block_.transpose() * block_;
    block_.setZero();
    in_block_ = 0;
}

bool BatchSolver::row(DwellRow& out) noexcept {
    if (in_block_ > 0) add_block();
    if (readings_ == 0 || !of_dwell_.allFinite()) return false;
    constexpr Eigen::Index kLast = kColumns - 1;
    const Sums& n = of_dwell_;
    // The start angle is free in the sums; so is the mean drift in what is left for the ramps.
    const Eigen::LLT<Eigen::Matrix3d> rates(n.topLeftCorner<3, 3>());
    if (rates.info() != Eigen::Success) return false;
    out.variance = rates.solve(Eigen::Matrix3d::Identity());
    const Eigen::Matrix<double, 3, kColumns> of_rates = out.variance * n.topRows<3>();
    const Eigen::Matrix<double, 3, kColumns> left =
        n.middleRows<3>(kRamps) - n.block<3, 3>(kRamps, 0) * of_rates;
    const Eigen::LLT<Eigen::Matrix3d> ramps(left.middleCols<3>(kRamps));
    if (ramps.info() != Eigen::Success) return false;
    out.ramp_variance = ramps.solve(Eigen::Matrix3d::Identity());
    const Eigen::Matrix<double, 3, kColumns> of_ramps = out.ramp_variance * left;
    out.rate = of_rates.col(kLast);
    out.ramp = of_ramps.col(kLast);
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            const auto gyro = static_cast<Eigen::Index>(j), g = static_cast<Eigen::Index>(group);
            const auto column = static_cast<Eigen::Index>(internal_index(group, j));
            out.regressors(gyro, g) = of_rates(gyro, column);
            out.ramp_regressors(gyro, g) = of_ramps(gyro, column);
        }
    }
    out.used = readings_;
    out.angles = first_path_ + path_sum_ / readings_;
    out.middle_s = 0.5 * (first_s_ + last_s_);
    out.duration_s = last_s_ - first_s_;
    return out.variance.allFinite() && out.ramp_variance.allFinite();
}

void BatchSolver::end_dwell(bool keep) noexcept {
    if (in_block_ > 0) add_block();
    if (keep) kept_ += of_dwell_;
    begin_dwell();
}

bool BatchSolver::solve(ParameterArray& value, Covariance& covariance) const noexcept {
    using Vector = Eigen::Matrix<double, kParameters, 1>;
    constexpr auto n = static_cast<Eigen::Index>(kParameters);
    if (!kept_.allFinite()) return false;
    // In units of the prior, which adds the unit matrix.
    const Eigen::Map<const Vector> scale(prior_.data());
    const Covariance information =
        Covariance::Identity() +
        Covariance(scale.asDiagonal() * kept_.topLeftCorner<n, n>() * scale.asDiagonal());
    const Covariance normalised = linear_algebra::covariance_inverse(information);
    const Vector right = scale.cwiseProduct(kept_.col(kColumns - 1).head<n>());
    Eigen::Map<Vector>(value.data()) = scale.cwiseProduct(Vector(normalised * right));
    covariance = scale.asDiagonal() * normalised * scale.asDiagonal();
    return covariance.allFinite();
}

}  // namespace vibrig::estimator
