#include "estimator/zeros/azimuth_gain.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::zeros {
namespace {

// 1 sigma before anything is known: gain, start in rad, lateness in s; and of a point, rad.
constexpr double kGain = 0.01, kStart = 0.1, kLateness = 0.1, kPoint = 1e-4;

}  // namespace

AzimuthGain::AzimuthGain(double bias_sigma) {
    const Eigen::Vector4d sigma(kGain, kStart, std::max(bias_sigma, 1e-9), kLateness);
    normal_ = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}

void AzimuthGain::add(const Point& point) {
    if (begun_) read_ += std::remainder(point.azimuth - last_, 2 * kPi);
    begun_ = true;
    last_ = point.azimuth;
    const Eigen::Vector4d h(read_, 1, point.time_s, point.rate);
    normal_ += h * h.transpose() / (kPoint * kPoint);
    right_ += h * ((point.turned - read_) / (kPoint * kPoint));
    value_ = linear_algebra::PivotedCholesky(normal_).solve(right_)(0);
}

void AzimuthGain::loosen(double turn) {
    const Eigen::Vector4d mean = linear_algebra::PivotedCholesky(normal_).solve(right_);
    Eigen::Matrix4d covariance = normal_.inverse();
    covariance(1, 1) += turn * turn;
    normal_ = covariance.inverse();
    right_ = normal_ * mean;
}

}  // namespace vibrig::estimator::zeros
