#include "estimator/uncertainty/forward_model.hpp"

#include <Eigen/LU>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/second_moment.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d turn_x(double a) {
    Matrix3d m;
    m << 1, 0, 0, 0, std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a);
    return m;
}
Matrix3d turn_y(double a) {
    Matrix3d m;
    m << std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a);
    return m;
}
Matrix3d turn_z(double a) {
    Matrix3d m;
    m << std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a), 0, 0, 0, 1;
    return m;
}

/// Gimbals whose axes are not square: C and the matrix from angle rates to the platform's rate.
struct Gimbals {
    Matrix3d c, to_rate;
};

Gimbals gimbals(const Vector3d& a, const std::array<double, 2>& skew) {
    const Matrix3d outer = turn_x(a[0]), inner = turn_y(a[1]), azimuth = turn_z(a[2]);
    const Matrix3d first = turn_z(skew[0]), second = turn_x(skew[1]);
    Gimbals g;
    g.c = azimuth * second * inner * first * outer;
    // A turn of the body about its own axis: dC/d angle = C [axis x] on the right side of it.
    const Matrix3d before_inner = azimuth * second, before_outer = before_inner * inner * first;
    // -dC/dtheta C' = -(before) [e x] (before)', whose axial vector is -(before) e.
    g.to_rate.col(0) = -before_outer * Vector3d::UnitX();
    g.to_rate.col(1) = -before_inner * Vector3d::UnitY();
    g.to_rate.col(2) = -Vector3d::UnitZ();
    return g;
}

Matrix3d level_tensor(const VibrationMoment& v) {
    const double k = v.kappa - 1.0;
    const LevelTensor& g = v.gamma;
    Matrix3d r;
    r << g[0], g[3], g[4], g[3], g[1], g[5], g[4], g[5], g[2];
    return k * r;
}

}  // namespace

double& Disturbance::resolver_rad(int order, std::size_t axis, std::size_t part) {
    for (Resolver& one : resolvers) {
        if (one.order == order) return one.rad[axis][part];
    }
    return resolvers.emplace_back(Resolver{order, {}}).rad[axis][part];
}

ForwardModel::ForwardModel(const Settings& settings, const ParameterArray& coefficients)
    : kinematics_(settings),
      model_(settings),
      coefficients_(coefficients),
      latitude_rad_(settings.latitude_deg * kRadPerDeg),
      azimuth_rad_(settings.azimuth_deg * kRadPerDeg) {}

Vector3d ForwardModel::apparent(const DwellRow& row, const Disturbance& d) const {
    const Vector3d theta = mapped(row.angles);
    // The true rig.
    const Vector3d earth = earth_rate_reference(kinematics_.level(), latitude_rad_ + d.latitude_rad,
                                                azimuth_rad_ + d.azimuth_rad);
    const Pose pose = kinematics_.pose(theta);
    const Gimbals rig = gimbals(theta, d.non_orthogonality_rad);
    // North, up and east in the reference frame, one a column.
    const Matrix3d level = pose.c.transpose() * pose.level;
    const Matrix3d to_platform = rig.c * level;
    const Vector3d up = to_platform.col(1);

    Matrix3d r = level_tensor(row.vibration);
    if (d.accelerometer_gain != 0) r *= 1.0 - 2.0 * d.accelerometer_gain;
    const Vector3d zero(d.accelerometer_zero_g[0], d.accelerometer_zero_g[1],
                        d.accelerometer_zero_g[2]);
    r *= (1.0 + zero.dot(up)) * (1.0 + zero.dot(up));
    Matrix3d cross;
    const auto& e = d.accelerometer_cross;
    cross << 0, e[0], e[1], e[2], 0, e[3], e[4], e[5], 0;
    Vector3d across(d.cross_north, 0, d.cross_east);
    const Vector3d seen = cross * up;
    across -= to_platform.transpose() * (seen - up.dot(seen) * up);
    // What moves along the vertical moves across it as well.
    Matrix3d slanted = Matrix3d::Identity();
    slanted.col(1) += across;
    r = slanted * r * slanted.transpose();
    const Matrix3d moment = up * up.transpose() + to_platform * r * to_platform.transpose();

    const Regressors h = model_.regressors(up, moment);
    Vector3d drift;
    for (std::size_t j = 0; j < kGyros; ++j) {
        double sum = 0;
        for (std::size_t g = 0; g < kGroups; ++g)
            sum += h[g][j] * coefficients_[internal_index(g, j)];
        drift[static_cast<Eigen::Index>(j)] = sum;
    }
    const Vector3d turning = model_.drift_sign() * drift - rig.c * earth;
    const Vector3d rates = rig.to_rate.inverse() * turning;

    // What the instruments show of it.
    Vector3d shown, measured;
    for (Eigen::Index k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        double error = d.encoder_zero_rad[i], slope = 0;
        for (const Disturbance::Resolver& of : d.resolvers) {
            const double n = of.order, c = std::cos(n * theta[k]), s = std::sin(n * theta[k]);
            error += of.rad[i][0] * c + of.rad[i][1] * s;
            slope += n * (-of.rad[i][0] * s + of.rad[i][1] * c);
        }
        shown[k] = theta[k] + error;
        measured[k] = rates[k] * (1.0 + slope) / (1.0 + d.time_base);
    }
    const Pose believed = kinematics_.pose(shown);
    const Regressors model = model_.regressors(believed.up, second_moment(believed, row.vibration));
    Vector3d out = model_.drift_sign() * (believed.m.inverse() * measured + believed.earth_rate);
    for (std::size_t j = 0; j < kGyros; ++j) {
        for (std::size_t g = 0; g < kGroups; ++g)
            out[static_cast<Eigen::Index>(j)] -= model[g][j] * coefficients_[internal_index(g, j)];
    }
    return out;
}

}  // namespace vibrig::estimator::uncertainty
