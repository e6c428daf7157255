#include "estimator/spectrum/swept_rates.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Mean over a block of what a vibration there sees of an elastic coefficient, less 1. Simpson's
/// rule over ln f, five points: narrower resonances than the block are no quadratic in it.
double weight(const std::array<double, 2>& hz, const Resonance& of) {
    constexpr std::array<double, 5> kPart{1, 4, 2, 4, 1};
    double sum = 0;
    for (std::size_t i = 0; i < kPart.size(); ++i)
        sum += kPart[i] / 12 *
               in_phase(hz[0] * std::pow(hz[1] / hz[0], 0.25 * static_cast<double>(i)), of);
    return sum - 1;
}

}  // namespace

SweptRates::SweptRates(const Settings& settings, const Sweep& sweep, std::size_t gyro,
                       double offset_sigma) {
    const Kinematics kinematics(settings);
    const double sign = DriftModel(settings).drift_sign();
    const auto g = static_cast<Index>(gyro);
    const double walk = 60 * settings.gyro_random_walk_deg_per_rt_h;  // arcsec per root second
    std::vector<double> rate, variance, with_next;
    std::vector<Eigen::Matrix<double, kBase, 1>> base;
    const SweepBlock* last = nullptr;
    for (const SweepBlock& block : sweep.blocks) {
        const SweepBlock* const before = std::exchange(last, block.moment ? &block : nullptr);
        if (last == nullptr) continue;
        const Vector3d angles = kinematics.gimbal_angles(block.angle_rad);
        const Attitude at = attitude(settings, angles, mapped(*block.moment));
        blocks_.push_back({{block.from_hz, block.to_hz}, at.vibration[gyro]});
        base.push_back(at.base[gyro]);
        if (before == nullptr) continue;
        const double dt = block.time_s - before->time_s;
        if (!(dt > 0))
            throw std::invalid_argument("sweep: found a block at " + std::to_string(block.time_s) +
                                        " s, expected it after " + std::to_string(before->time_s));
        const Vector3d from = kinematics.gimbal_angles(before->angle_rad);
        Vector3d turned = angles - from;
        for (Index i = 0; i < 3; ++i) turned[i] = wrap(turned[i]);
        const Pose pose = kinematics.pose(from + turned / 2);
        const Eigen::Matrix3d to_platform = pose.m.inverse();
        rate.push_back(sign *
                       (to_platform.row(g).dot(turned) * kArcsecPerRad / dt + pose.earth_rate[g]));
        const double one =
            settings.resolver_arcsec * settings.resolver_arcsec * to_platform.row(g).squaredNorm();
        const auto read = [one](const SweepBlock& b) {
            return one / static_cast<double>(std::max<std::size_t>(b.samples, 1));
        };
        // Means over blocks of a random walk, one after the other.
        variance.push_back((2.0 / 3 * walk * walk * dt + read(*before) + read(block)) / (dt * dt));
        with_next.push_back((walk * walk * dt / 6 - read(block)) / (dt * dt));
        before_.push_back(blocks_.size() - 2);
    }
    const auto n = static_cast<Index>(rate.size());
    diagonal_.resize(n);
    below_ = VectorXd::Zero(n);
    for (Index i = 0; i < n; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const bool goes_on = i > 0 && before_[k] == before_[k - 1] + 1;
        if (goes_on) below_[i] = with_next[k - 1] / diagonal_[i - 1];
        diagonal_[i] = std::sqrt(variance[k] - below_[i] * below_[i]);
    }
    common_ = VectorXd::Zero(n);
    const VectorXd alike = whitened(VectorXd::Ones(n));
    // I - (1 - s) u u' with s^2 what is left of the direction u: the square root of what takes the
    // common part out.
    const double size = alike.squaredNorm();
    if (n > 0)
        common_ = alike / std::sqrt(size) *
                  std::sqrt(1 - std::sqrt(1 / (1 + size * offset_sigma * offset_sigma)));
    MatrixXd rows(n, kBase + 1);
    for (Index i = 0; i < n; ++i) {
        const std::size_t k = before_[static_cast<std::size_t>(i)];
        rows.row(i) << (base[k] + base[k + 1]).transpose() / 2, rate[static_cast<std::size_t>(i)];
    }
    rows = whitened(std::move(rows));
    base_ = rows.leftCols(kBase);
    rate_ = rows.rightCols<1>();
}

MatrixXd SweptRates::whitened(MatrixXd rows) const {
    for (Index i = 0; i < rows.rows(); ++i) {
        if (below_[i] != 0) rows.row(i) -= below_[i] * rows.row(i - 1);
        rows.row(i) /= diagonal_[i];
    }
    rows -= common_ * (common_.transpose() * rows);
    return rows;
}

MatrixXd SweptRates::elastic(const Resonance& of) const {
    std::vector<double> weights;
    weights.reserve(blocks_.size());
    for (const Seen& block : blocks_) weights.push_back(weight(block.hz, of));
    MatrixXd rows(size(), kElastic);
    for (Index i = 0; i < size(); ++i) {
        const std::size_t k = before_[static_cast<std::size_t>(i)];
        rows.row(i) =
            (weights[k] * blocks_[k].vibration + weights[k + 1] * blocks_[k + 1].vibration)
                .transpose() /
            2;
    }
    return whitened(std::move(rows));
}

}  // namespace vibrig::estimator::spectrum
