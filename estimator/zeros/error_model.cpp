#include "estimator/zeros/error_model.hpp"

#include <cmath>

namespace vibrig::estimator::zeros {

Eigen::Vector3d earth_rate(const Site& site) {
    return {0, kEarthRate * std::cos(site.latitude_rad), kEarthRate * std::sin(site.latitude_rad)};
}

StateMatrix error_dynamics(const Eigen::Matrix3d& c, const Eigen::Vector3d& f, const Site& site) {
    const Eigen::Vector3d w = earth_rate(site);
    const double r = site.radius_m;
    StateMatrix a = StateMatrix::Zero();
    a.block<3, 3>(kPhi, kPhi) = -skew(w);
    a(kPhi + 0, kVelocity + 1) = -1 / r;
    a(kPhi + 1, kVelocity + 0) = 1 / r;
    a(kPhi + 2, kVelocity + 0) = std::tan(site.latitude_rad) / r;
    a(kPhi + 1, kPosition) = -w[2];
    a(kPhi + 2, kPosition) = w[1];
    a.block<3, 3>(kPhi, kGyro) = -c;
    a.block<3, 3>(kVelocity, kPhi) = skew(f);
    a.block<3, 3>(kVelocity, kVelocity) = -2 * skew(w);
    a(kVelocity + 2, kPosition + 2) = 2 * site.gravity_mps2 / r;
    a.block<3, 3>(kVelocity, kAccelerometer) = c;
    a(kPosition, kVelocity + 1) = 1 / r;
    a(kPosition + 1, kVelocity + 0) = 1 / (r * std::cos(site.latitude_rad));
    a(kPosition + 2, kVelocity + 2) = 1;
    return a;
}

MeasurementMatrix measurement_matrix(const Site& site) {
    MeasurementMatrix h = MeasurementMatrix::Zero();
    h.block<3, 3>(0, kVelocity).setIdentity();
    // Rows east, north, up; the states are latitude first.
    h(3, kPosition + 1) = site.radius_m * std::cos(site.latitude_rad);
    h(4, kPosition) = site.radius_m;
    h(5, kPosition + 2) = 1;
    return h;
}

}  // namespace vibrig::estimator::zeros
