#include "estimator/zeros/simulation.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/filter/angles.hpp"
#include "estimator/zeros/strapdown.hpp"
#include "estimator/zeros/units.hpp"

namespace vibrig::estimator::zeros {
struct UnitSimulation::Impl {
    CalibrationSettings settings;
    UnitErrors errors;
    double period_s;
    double real_rate;
    std::mt19937_64 generator;
    std::normal_distribution<double> normal{};
    std::size_t k = 0;
    Eigen::Matrix3d c = Eigen::Matrix3d::Identity();  ///< true, body to navigation
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();

    [[nodiscard]] double azimuth(double t) const {
        return settings.plan.azimuth_deg(t * real_rate) * kRadPerDeg;
    }
    [[nodiscard]] Eigen::Matrix3d attitude(double t) const {
        const double psi = azimuth(t) + (settings.heading_deg + errors.azimuth_deg) * kRadPerDeg;
        Eigen::Matrix3d turned =
            rotation({errors.tilt_east_deg * kRadPerDeg, errors.tilt_north_deg * kRadPerDeg, 0}) *
            rotation({0, 0, psi});
        if (settings.inverted) {
            turned.col(1) *= -1;
            turned.col(2) *= -1;
        }
        if (settings.upright == 2) return turned;
        // The columns are the two level axes and the upright one: in the platform's order.
        Eigen::Matrix3d platform;
        for (int i = 0; i < 3; ++i) platform.col((settings.upright + 1 + i) % 3) = turned.col(i);
        return platform;
    }
    /// Of the unit at its lever arm. At the instant in which the azimuth turns round that is the
    /// velocity it came with, as it is for the filter, whose rate is that of the last increment.
    [[nodiscard]] Eigen::Vector3d unit_velocity(double t) const {
        constexpr double kBack = 1e-4;
        return (attitude(t) - attitude(t - kBack)) * vector(settings.lever_arm_m) / kBack;
    }
    Eigen::Vector3d noise(double sigma) {
        const double x = normal(generator);
        const double y = normal(generator);
        return Eigen::Vector3d(x, y, normal(generator)) * sigma;
    }
    Increment next() {
        const double t = static_cast<double>(k++) * period_s;
        Increment in;
        in.time_s = t;
        in.azimuth_rad = azimuth(t);
        if (k == 1) {
            c = attitude(0);
            velocity = unit_velocity(0);
            return in;
        }
        const Site& site = settings.site;
        const Eigen::Matrix3d c1 = attitude(t);
        const Eigen::Vector3d v1 = unit_velocity(t);
        const Eigen::Vector3d w = earth_rate(site);
        // The turn from c to c1 seen from space, in body axes: constant within the interval.
        const Eigen::Matrix3d relative = c.transpose() * rotation(w * period_s) * c1;
        Eigen::Vector3d turn(relative(2, 1) - relative(1, 2), relative(0, 2) - relative(2, 0),
                             relative(1, 0) - relative(0, 1));
        const double sine = 0.5 * turn.norm();
        turn *= sine > 1e-12 ? std::asin(std::min(1.0, sine)) / (2 * sine) : 0.5;
        const double wt = 2 * kPi * 15;
        const double shaken = errors.vibration_g * site.gravity_mps2 / wt *
                              (std::cos(wt * (t - period_s)) - std::cos(wt * t));
        const Eigen::Vector3d in_navigation =
            v1 - velocity + Eigen::Vector3d(0, 0, site.gravity_mps2 * period_s + shaken) +
            2 * w.cross(0.5 * (v1 + velocity)) * period_s;
        const Eigen::Matrix3d middle = rotation(-0.5 * period_s * w) * c * rotation(0.5 * turn);
        Eigen::Vector3d dv = middle.transpose() * in_navigation;
        const Eigen::Vector3d seen =
            vector(errors.scale).cwiseProduct(dv) + matrix(errors.accelerometer_cross) * dv;
        dv += seen + vector(errors.zero_mg) * (1e-3 * site.gravity_mps2 * period_s);
        turn += (matrix(errors.gyro_cross) * turn).eval();
        turn += vector(errors.gyro_bias_deg_h) * (kRadPerDeg / 3600 * period_s);
        const double root = std::sqrt(period_s);
        turn += noise(settings.noise.angle_random_walk * kRadPerDeg / 60 * root);
        dv += noise(settings.noise.velocity_random_walk * site.gravity_mps2 * root);
        for (std::size_t i = 0; i < 3; ++i) {
            in.turn_rad[i] = turn[static_cast<Eigen::Index>(i)];
            in.velocity_mps[i] = dv[static_cast<Eigen::Index>(i)];
        }
        const Eigen::Vector3d dv_ref = noise(settings.noise.velocity_reference);
        const Eigen::Vector3d dp_ref = noise(settings.noise.position_reference);
        for (std::size_t i = 0; i < 3; ++i) {
            in.reference_velocity_mps[i] = dv_ref[static_cast<Eigen::Index>(i)];
            in.reference_position_m[i] = dp_ref[static_cast<Eigen::Index>(i)];
        }
        c = c1;
        velocity = v1;
        return in;
    }
};

UnitSimulation::UnitSimulation(const CalibrationSettings& settings, const UnitErrors& errors,
                               double period_s, std::uint64_t seed, double real_rate)
    : impl_(std::make_unique<Impl>(
          Impl{settings, errors, period_s, real_rate, std::mt19937_64(seed)})) {}
UnitSimulation::~UnitSimulation() = default;
UnitSimulation::UnitSimulation(UnitSimulation&&) noexcept = default;
Increment UnitSimulation::next() { return impl_->next(); }

Calibration simulate(const CalibrationSettings& settings, const UnitErrors& errors, double period_s,
                     std::uint64_t seed) {
    Calibration calibration(settings);
    UnitSimulation unit(settings, errors, period_s, seed);
    const auto steps = static_cast<std::size_t>(std::llround(settings.plan.duration_s / period_s));
    for (std::size_t k = 0; k <= steps && calibration.add(unit.next()); ++k) {
    }
    return calibration;
}

}  // namespace vibrig::estimator::zeros
