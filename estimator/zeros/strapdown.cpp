#include "estimator/zeros/strapdown.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace vibrig::estimator::zeros {

Eigen::Matrix3d rotation(const Eigen::Vector3d& v) {
    const double square = v.squaredNorm();
    const double angle = std::sqrt(square);
    const double a = angle > 1e-4 ? std::sin(angle) / angle : 1 - square / 6;
    const double b = angle > 1e-4 ? (1 - std::cos(angle)) / square : 0.5 - square / 24;
    const Eigen::Matrix3d s = skew(v);
    return Eigen::Matrix3d::Identity() + a * s + b * s * s;
}

void Strapdown::advance(const Eigen::Vector3d& turn, const Eigen::Vector3d& velocity, double dt_s) {
    const double r = site_.radius_m;
    const double latitude = site_.latitude_rad + p_[1] / r;
    Eigen::Vector3d w(0, kEarthRate * std::cos(latitude), kEarthRate * std::sin(latitude));
    const Eigen::Vector3d transport(-v_[1] / r, v_[0] / r, v_[0] * std::tan(latitude) / r);
    const Eigen::Vector3d of_frame = (w + transport) * dt_s;
    // The specific force turned into navigation axes with the attitude of the interval's middle.
    const Eigen::Matrix3d middle = rotation(-0.5 * of_frame) * c_ * rotation(0.5 * turn);
    const double gravity = -site_.gravity_mps2 * (1 - 2 * p_[2] / r);
    const Eigen::Vector3d coriolis = (2 * w + transport).cross(v_);
    const Eigen::Vector3d before = v_;
    v_ += middle * velocity + (Eigen::Vector3d(0, 0, gravity) - coriolis) * dt_s;
    p_ += 0.5 * dt_s * (before + v_);
    c_ = rotation(-of_frame) * c_ * rotation(turn);
    // Rows back to unit length and right angles, to first order.
    c_ = (0.5 * (3 * Eigen::Matrix3d::Identity() - c_ * c_.transpose()) * c_).eval();
}

void Strapdown::correct(const Eigen::Vector3d& phi, const Eigen::Vector3d& velocity,
                        const Eigen::Vector3d& position) {
    c_ = (rotation(phi) * c_).eval();
    v_ -= velocity;
    p_ -= position;
}

}  // namespace vibrig::estimator::zeros
