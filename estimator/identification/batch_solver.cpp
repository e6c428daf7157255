#include "estimator/identification/batch_solver.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <cstring>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/product.hpp"
#include "estimator/filter/second_moment.hpp"

namespace vibrig::estimator {
namespace {

/// A ramp's unit is the change over so long; its zero, which is free, half way.
constexpr double kRamp_s = 100.0, kRampCentre_s = 50.0;

/// Of the reading whose level and noise together have the variance s, lower triangle: in the
/// order of Eigen 3.4's LLT and solve().
NormalSums::Whitening whitening(const Eigen::Matrix3d& s, double noise) noexcept {
    NormalSums::Whitening out;
    const double l00 = std::sqrt(s(0, 0));
    const double l10 = s(1, 0) / l00, l20 = s(2, 0) / l00;
    const double l11 = std::sqrt(s(1, 1) - l10 * l10);
    const double l21 = (s(2, 1) - l20 * l10) / l11;
    const double l22 = std::sqrt(s(2, 2) - (l20 * l20 + l21 * l21));
    const double i0 = 1 / l00, i1 = 1 / l11, i2 = 1 / l22;
    for (std::size_t j = 0; j < 3; ++j) {
        double x0 = j == 0 ? i0 : 0;
        double x1 = ((j == 1 ? 1 : 0) - x0 * l10) * i1;
        double x2 = ((j == 2 ? 1 : 0) - x0 * l20 - x1 * l21) * i2;
        x2 *= i2;
        x1 = (x1 - l21 * x2) * i1;
        x0 = (x0 - (l10 * x1 + l20 * x2)) * i0;
        out.left[0][j] = noise * x0;
        out.left[1][j] = noise * x1;
        out.left[2][j] = noise * x2;
    }
    out.inverse[0] = i0;
    out.inverse[1] = i1;
    out.inverse[2] = i2;
    out.below[0] = l10;
    out.below[1] = l20;
    out.below[2] = l21;
    return out;
}

template <typename Array>
void clear(Array& array) noexcept {
    std::memset(array, 0, sizeof array);
}

}  // namespace

BatchSolver::BatchSolver(const Settings& settings, const ParameterArray& prior)
    : kinematics_(settings), model_(settings), noise_(FilterNoise::of(settings)), prior_(prior) {}

void BatchSolver::begin_dwell() noexcept {
    started_ = false;
    in_block_ = 0;
    readings_ = 0;
    clear(of_dwell_);
}

void BatchSolver::start(double time_s, const Eigen::Vector3d& angles_rad) noexcept {
    path_ = angles_rad;
    time_s_ = time_s;
    if (readings_ == 0) {
        first_s_ = last_s_ = time_s;
        first_path_ = angles_rad;
        path_sum_.setZero();
    }
    clear(difference_);
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
    double scale[NormalSums::kColumns]{};
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j)
            scale[internal_index(group, j)] = model_.drift_sign() * dt * h[group][j];
    }
    const double of_ramp = model_.drift_sign() * dt * (time_s - first_s_ - kRampCentre_s) / kRamp_s;
    for (std::size_t j = 0; j < 3; ++j) scale[static_cast<std::size_t>(kRamps) + j] = of_ramp;
    double m[3][3];
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c)
            m[r][c] = pose.m(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
    }
    kernel_->integrate(difference_, scale, m);
    constexpr auto kAngles = static_cast<std::size_t>(kColumns - 1);
    const Eigen::Vector3d turned = dt * (pose.m * pose.earth_rate);
    for (std::size_t k = 0; k < 3; ++k)
        difference_[k][kAngles] += turned[static_cast<Eigen::Index>(k)];
    const Eigen::Map<const Eigen::Vector3d> share(noise_.gyro_share.data());
    const Eigen::Matrix3d walking = pose.m * share.asDiagonal();
    walked_ += product(noise_.walk * dt * walking, walking.transpose());
    if (!used) return;

    for (Eigen::Index k = 0; k < 3; ++k) {
        const double reading = wrap_next_to(angles_rad[k], path_[k]);
        difference_[k][kAngles] += (reading - path_[k]) * kArcsecPerRad;
        path_[k] = reading;
        path_sum_[k] += reading - first_path_[k];
    }
    last_s_ = time_s;
    ++readings_;
    // Local level: S = P + R, what is left after the reading is R S^-1 of what was before.
    const Eigen::Matrix3d s = walked_ + noise_.angle_variance * Eigen::Matrix3d::Identity();
    const NormalSums::Whitening by = whitening(s, noise_.angle_variance);
    kernel_->whiten(difference_, by, &block_[3 * in_block_]);
    Eigen::Matrix3d left;
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c)
            left(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = by.left[r][c];
    }
    walked_ = product(left, walked_);
    if (++in_block_ == kReadingsPerBlock) add_block();
}

void BatchSolver::add_block() noexcept {
    kernel_->add_block(block_, of_dwell_);
    clear(block_);
    in_block_ = 0;
}

BatchSolver::Sums BatchSolver::of_dwell() const noexcept {
    Sums out;
    for (Eigen::Index c = 0; c < kColumns; ++c) {
        for (Eigen::Index r = c; r < kColumns; ++r) out(r, c) = out(c, r) = of_dwell_[c][r];
    }
    return out;
}

bool BatchSolver::row(DwellRow& out) noexcept {
    if (in_block_ > 0) add_block();
    constexpr Eigen::Index kLast = kColumns - 1;
    const Sums n = of_dwell();
    if (readings_ == 0 || !n.allFinite()) return false;
    // The start angle is free in the sums; so is the mean drift in what is left for the ramps.
    const Eigen::LLT<Eigen::Matrix3d> rates(n.topLeftCorner<3, 3>());
    if (rates.info() != Eigen::Success) return false;
    const Eigen::Matrix3d variance = rates.solve(Eigen::Matrix3d::Identity());
    const Eigen::Matrix<double, 3, kColumns> of_rates = variance * n.topRows<3>();
    const Eigen::Matrix<double, 3, kColumns> left =
        n.middleRows<3>(kRamps) - n.block<3, 3>(kRamps, 0) * of_rates;
    const Eigen::LLT<Eigen::Matrix3d> ramps(left.middleCols<3>(kRamps));
    if (ramps.info() != Eigen::Success) return false;
    const Eigen::Matrix3d ramp_variance = ramps.solve(Eigen::Matrix3d::Identity());
    const Eigen::Matrix<double, 3, kColumns> of_ramps = ramp_variance * left;
    mapped(out.rate) = of_rates.col(kLast);
    mapped(out.variance) = variance;
    mapped(out.ramp) = of_ramps.col(kLast);
    mapped(out.ramp_variance) = ramp_variance;
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            const auto gyro = static_cast<Eigen::Index>(j);
            const auto column = static_cast<Eigen::Index>(internal_index(group, j));
            out.regressors[j][group] = of_rates(gyro, column);
            out.ramp_regressors[j][group] = of_ramps(gyro, column);
        }
    }
    out.used = readings_;
    mapped(out.angles) = first_path_ + path_sum_ / readings_;
    out.middle_s = 0.5 * (first_s_ + last_s_);
    out.duration_s = last_s_ - first_s_;
    return variance.allFinite() && ramp_variance.allFinite();
}

void BatchSolver::end_dwell(bool keep, double walked) noexcept {
    if (in_block_ > 0) add_block();
    if (keep) {
        if (walked > 0) let_biases_walk(walked);
        kept_ += of_dwell();
        kept_now_ += of_dwell();
    }
    begin_dwell();
}

/// Of the biases before the walk nothing is asked any more: they are integrated out, N - N_D
/// (1/q + N_DD)^-1 N_D' with all columns, which is least squares with the walk's kernel.
void BatchSolver::let_biases_walk(double variance) noexcept {
    static_assert(internal_index(kDt, 0) == 0 && internal_index(kDt, 2) == 2);
    const Eigen::Matrix3d core =
        kept_now_.topLeftCorner<3, 3>() + Eigen::Matrix3d::Identity() / variance;
    const Eigen::LLT<Eigen::Matrix3d> factor(core);
    const Eigen::Matrix<double, 3, kColumns> of_biases = kept_now_.topRows<3>();
    const Eigen::Matrix<double, 3, kColumns> share = factor.solve(of_biases);
    kept_now_ -= of_biases.transpose().lazyProduct(share);
}

bool BatchSolver::solve(ParameterArray& value, Covariance& covariance, Bias bias) const noexcept {
    const Sums& kept = bias == Bias::now ? kept_now_ : kept_;
    using Vector = Eigen::Matrix<double, kParameters, 1>;
    constexpr auto n = static_cast<Eigen::Index>(kParameters);
    if (!kept.allFinite()) return false;
    // In units of the prior, which adds the unit matrix.
    const Eigen::Map<const Vector> scale(prior_.data());
    const Covariance information =
        Covariance::Identity() +
        Covariance(scale.asDiagonal() * kept.topLeftCorner<n, n>() * scale.asDiagonal());
    const Covariance normalised = linear_algebra::covariance_inverse(information);
    const Vector right = scale.cwiseProduct(kept.col(kColumns - 1).head<n>());
    Eigen::Map<Vector>(value.data()) = scale.cwiseProduct(Vector(normalised * right));
    covariance = scale.asDiagonal() * normalised * scale.asDiagonal();
    return covariance.allFinite();
}

}  // namespace vibrig::estimator
