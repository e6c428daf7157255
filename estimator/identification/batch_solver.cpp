#include "estimator/identification/batch_solver.hpp"

#include <Eigen/Cholesky>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator {

BatchSolver::BatchSolver(const Settings& settings, const ParameterArray& prior)
    : kinematics_(settings), model_(settings), noise_(FilterNoise::of(settings)), prior_(prior) {
    block_.setZero();
}

void BatchSolver::begin_dwell() noexcept {
    started_ = false;
    in_block_ = 0;
    of_dwell_.setZero();
}

void BatchSolver::start(double time_s, const Eigen::Vector3d& angles_rad) noexcept {
    path_ = angles_rad;
    time_s_ = time_s;
    difference_.setZero();
    walked_ = noise_.angle_variance * Eigen::Matrix3d::Identity();
    started_ = true;
}

void BatchSolver::step(double time_s, const Eigen::Vector3d& angles_rad, double kappa,
                       bool used) noexcept {
    if (!started_) return;
    const double dt = time_s - time_s_;
    time_s_ = time_s;
    const Pose pose = kinematics_.pose(path_);
    const Regressors h = model_.regressors(pose.up, kappa);
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            difference_.col(static_cast<Eigen::Index>(internal_index(group, j))) +=
                model_.drift_sign() * dt * h[group][j] * pose.m.col(static_cast<Eigen::Index>(j));
        }
    }
    auto angles = difference_.col(kColumns - 1);
    angles += dt * (pose.m * pose.earth_rate);
    walked_ += noise_.walk * dt * (pose.m * pose.m.transpose());
    if (!used) return;

    for (Eigen::Index k = 0; k < 3; ++k) {
        const double reading = wrap_next_to(angles_rad[k], path_[k]);
        angles[k] += (reading - path_[k]) * kArcsecPerRad;
        path_[k] = reading;
    }
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
    const Vector right = scale.cwiseProduct(kept_.col(n).head<n>());
    Eigen::Map<Vector>(value.data()) = scale.cwiseProduct(Vector(normalised * right));
    covariance = scale.asDiagonal() * normalised * scale.asDiagonal();
    return covariance.allFinite();
}

}  // namespace vibrig::estimator
