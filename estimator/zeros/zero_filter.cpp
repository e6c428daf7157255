#include "estimator/zeros/zero_filter.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/zeros/units.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vibrig::estimator::zeros {
namespace {

/// The attitude of the error model may turn by so little (0.5 deg at 5 deg/s) before its matrix is
/// taken anew.
constexpr double kPart_s = 0.1;
constexpr double kExact = 1e-9;  ///< of a misalignment that is declared to be none, rad

/// Columns: the body's axes in east, north and up.
Eigen::Matrix3d level_attitude(double azimuth, bool inverted) {
    Eigen::Matrix3d c;
    c << std::cos(azimuth), -std::sin(azimuth), 0, std::sin(azimuth), std::cos(azimuth), 0, 0, 0, 1;
    if (inverted) {
        c.col(1) *= -1;
        c.col(2) *= -1;
    }
    return c;
}

}  // namespace

double cross_prior(const CalibrationSettings& settings, std::size_t of, std::size_t axis) noexcept {
    return of == axis ? settings.initial.gain : std::max(settings.noise.misalignment, kExact);
}

ZeroFilter::ZeroFilter(const CalibrationSettings& settings, double heading_rad)
    : settings_(settings),
      lever_(vector(settings.lever_arm_m)),
      strapdown_(settings.site, level_attitude(heading_rad, settings.inverted),
                 level_attitude(heading_rad, settings.inverted) * lever_) {
    h_.leftCols<kStates>() = measurement_matrix(settings.site);
    const Initial& start = settings.initial;
    const Site& site = settings.site;
    const double metre = start.position_m / site.radius_m;
    FilterVector sigma;
    sigma << start.tilt_deg * kRadPerDeg, start.tilt_deg * kRadPerDeg,
        start.azimuth_deg * kRadPerDeg, Eigen::Vector3d::Constant(start.velocity_mps), metre,
        metre / std::cos(site.latitude_rad), start.position_m,
        Eigen::Vector3d::Constant(start.gyro_bias_deg_h * kDegPerHour),
        Eigen::Vector3d::Constant(start.zero_mg * 1e-3 * site.gravity_mps2),
        Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t k = 0; k < 6; ++k)
        sigma[kCross + static_cast<Eigen::Index>(k)] = cross_prior(settings, k / 2, k % 2);
    p_ = sigma.cwiseAbs2().asDiagonal();
}

void ZeroFilter::advance(const Eigen::Vector3d& turn, const Eigen::Vector3d& velocity,
                         double dt_s) {
    const Eigen::Vector3d true_turn = turn - gyro_bias_ * dt_s;
    // What of its own tilt the unit shows on the wrong axis, or too large.
    const Eigen::Vector3d level = strapdown_.c().row(2) * settings_.site.gravity_mps2;
    const Eigen::Vector3d true_velocity = velocity - (zero_ + cross_ * level.head<2>()) * dt_s;
    const Eigen::Matrix3d before = strapdown_.c();
    strapdown_.advance(true_turn, true_velocity, dt_s);
    rate_ = true_turn / dt_s;
    const Eigen::Matrix3d middle = 0.5 * (before + strapdown_.c());
    mean_c_ += middle * dt_s;
    part_s_ += dt_s;
    if (part_s_ >= kPart_s) {
        propagate();
    }
}

void ZeroFilter::turn_back(double azimuth) {
    // About the gyro's axis, not the vertical: a unit that stands off level would keep the turn's
    // share of its tilt.
    const Eigen::Vector3d axis = strapdown_.c().col(2);
    strapdown_.correct((axis[2] > 0 ? -azimuth : azimuth) * axis, {0, 0, 0}, {0, 0, 0});
}

void ZeroFilter::propagate() {
    if (part_s_ <= 0) {
        return;
    }
    // The specific force of the standing axis, not the measured one: what a wrong attitude makes of
    // that would pass for information on states that cannot be observed.
    const Eigen::Vector3d f(0, 0, settings_.site.gravity_mps2);
    const Eigen::Matrix3d c = mean_c_ / part_s_;
    FilterMatrix a = FilterMatrix::Zero();
    a.topLeftCorner<kStates, kStates>() = error_dynamics(c, f, settings_.site);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 2; ++j) {
            a.block<3, 1>(kVelocity, kCross + 2 * i + j) = c.col(i) * (c(2, j) * f[2]);
        }
    }
    a *= part_s_;
    const FilterMatrix step = FilterMatrix::Identity() + a + 0.5 * a * a;
    phi_ = (step * phi_).eval();
    since_update_s_ += part_s_;
    part_s_ = 0;
    mean_c_.setZero();
}

void ZeroFilter::loosen(double tilt, double velocity, double position) {
    propagate();
    const double metre = position / settings_.site.radius_m;
    FilterVector sigma = FilterVector::Zero();
    sigma.segment<3>(kPhi).setConstant(tilt);
    sigma.segment<3>(kVelocity).setConstant(velocity);
    sigma.segment<3>(kPosition) << metre, metre / std::cos(settings_.site.latitude_rad), position;
    // Errors of now, seen from the last update: the propagation is near enough to identity.
    p_ += FilterMatrix(sigma.cwiseAbs2().asDiagonal());
}

ZeroFilter::Innovation ZeroFilter::update(const Eigen::Vector3d& velocity,
                                          const Eigen::Vector3d& position) {
    propagate();
    const Noise& noise = settings_.noise;
    const double t = since_update_s_;
    const double turn = noise.angle_random_walk * kDegPerRootHour;
    const double force = noise.velocity_random_walk * settings_.site.gravity_mps2;
    const double gyro = noise.gyro_drift * kDegPerHour / 60;
    const double zero = noise.accelerometer_drift * 1e-3 * settings_.site.gravity_mps2 / 60;
    FilterVector q = FilterVector::Zero();
    q.segment<3>(kPhi).setConstant(turn * turn * t);
    q.segment<3>(kVelocity).setConstant(force * force * t);
    q.segment<3>(kGyro).setConstant(gyro * gyro * t);
    q.segment<3>(kAccelerometer).setConstant(zero * zero * t);
    p_ = (phi_ * p_ * phi_.transpose()).eval();
    p_ += FilterMatrix(q.asDiagonal());
    phi_.setIdentity();
    since_update_s_ = 0;

    // The unit turns about the axis; relative to the Earth by what the gyros say without it.
    const Eigen::Matrix3d& c = strapdown_.c();
    const Eigen::Vector3d rate = rate_ - c.transpose() * earth_rate(settings_.site);
    Eigen::Matrix<double, 6, 1> z;
    z << strapdown_.velocity() - velocity - c * rate.cross(lever_),
        strapdown_.position() - position - c * lever_;
    Eigen::Matrix<double, 6, 1> r;
    r << Eigen::Vector3d::Constant(noise.velocity_reference * noise.velocity_reference),
        Eigen::Vector3d::Constant(noise.position_reference * noise.position_reference);
    using Square = Eigen::Matrix<double, 6, 6>;
    const Eigen::Matrix<double, kFilterStates, 6> ph = p_ * h_.transpose();
    Square s = h_ * ph;
    s.diagonal() += r;
    const Square weight = linear_algebra::positive_inverse(s);
    const Eigen::Matrix<double, kFilterStates, 6> gain = ph * weight;
    Innovation innovation;
    innovation.nis = z.dot(weight * z);
    innovation.ratio = z.cwiseAbs2().cwiseQuotient(s.diagonal());
    const FilterVector x = gain * z;
    // Joseph's form keeps the covariance symmetric and positive.
    const FilterMatrix rest = FilterMatrix::Identity() - gain * h_;
    p_ = (rest * p_ * rest.transpose()).eval() + gain * r.asDiagonal() * gain.transpose();
    p_ = (0.5 * (p_ + p_.transpose())).eval();

    const double radius = settings_.site.radius_m;
    strapdown_.correct(x.segment<3>(kPhi), x.segment<3>(kVelocity),
                       {x[kPosition + 1] * radius * std::cos(settings_.site.latitude_rad),
                        x[kPosition] * radius, x[kPosition + 2]});
    gyro_bias_ += x.segment<3>(kGyro);
    zero_ += x.segment<3>(kAccelerometer);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 2; ++j) cross_(i, j) += x[kCross + 2 * i + j];
    }
    return innovation;
}

}  // namespace vibrig::estimator::zeros
