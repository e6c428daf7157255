#include "estimator/commissioning/told_apart.hpp"

#include <Eigen/Core>
#include <Eigen/LU>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

constexpr double kLeast_mg = 10, kLeast_deg_h = 0.5;

/// What a rig of these settings would show.
struct Expected {
    Eigen::Vector3d force_g, slope_deg_h;
};

Expected expected(const Suspect& of, const std::array<double, 3>& reading_rad) {
    const Settings& s = of.settings;
    const Kinematics kinematics(s);
    const Pose pose = kinematics.pose(kinematics.gimbal_angles(reading_rad));
    Eigen::Matrix3d matrix;
    Eigen::Vector3d zero, sign;
    for (int i = 0; i < 3; ++i) {
        const auto at = static_cast<std::size_t>(i);
        zero[i] = s.accelerometer_zero_g[at];
        sign[i] = s.encoder_sign[at];
        for (int k = 0; k < 3; ++k)
            matrix(i, k) = s.accelerometer_matrix[at][static_cast<std::size_t>(k)];
    }
    // What stands on the vertical looks like drift of the input axes.
    const Eigen::Vector3d level = pose.earth_rate - pose.earth_rate.dot(pose.up) * pose.up;
    return {matrix.inverse() * pose.up + zero, -of.time_factor * sign.cwiseProduct(pose.m * level)};
}

}  // namespace

std::string ToldApart::words() const {
    return text("told apart at (%g, %g, %g) deg, by %.3g %s", position_deg[0], position_deg[1],
                position_deg[2], by_deg_h > 0 ? by_deg_h : by_mg, by_deg_h > 0 ? "deg/h" : "mg");
}

std::optional<ToldApart> told_apart(const Settings& settings, const Suspect& a, const Suspect& b) {
    ToldApart force, drift;
    for (double outer = -120; outer <= 120; outer += 30) {
        for (const double inner : {0.0, 25.0, -25.0}) {
            for (double azimuth = 0; azimuth < 360; azimuth += 45) {
                const std::array<double, 3> position{outer, inner,
                                                     azimuth > 180 ? azimuth - 360 : azimuth};
                auto reading = encoder_deg(settings, position);
                for (double& angle : reading) angle *= kRadPerDeg;
                const Expected one = expected(a, reading), other = expected(b, reading);
                const double mg = 1e3 * (one.force_g - other.force_g).norm();
                const double deg_h = (one.slope_deg_h - other.slope_deg_h).norm();
                if (mg > force.by_mg) force = {position, mg, 0};
                if (deg_h > drift.by_deg_h) drift = {position, mg, deg_h};
            }
        }
    }
    if (force.by_mg >= kLeast_mg) return force;
    if (drift.by_deg_h >= kLeast_deg_h) return drift;
    return std::nullopt;
}

std::string told_apart_words(const Settings& settings, const std::vector<Suspect>& suspects) {
    if (suspects.size() < 2) return {};
    const auto where = told_apart(settings, suspects[0], suspects[1]);
    return where ? where->words() : "no position tells the first two apart";
}

}  // namespace vibrig::estimator::commissioning
