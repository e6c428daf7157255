#include "estimator/plan/positions.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator::plan {

namespace {

constexpr double kDust = 1e-9;
constexpr double kLargestInner_deg = 80;  // beyond, the kinematics come near their singularity

/// In (-180, 180], without rounding dust.
double wrapped_deg(double deg) {
    double w = std::remainder(deg, 360.0);
    if (w <= -180 + kDust) w += 360;
    const double near = std::round(w);
    return std::abs(w - near) < kDust ? near + 0.0 : w;
}

bool within(double deg, double low, double high) {
    for (const double turn : {-360.0, 0.0, 360.0}) {
        if (deg + turn >= low - kDust && deg + turn <= high + kDust) return true;
    }
    return false;
}

/// Both ways to put the vertical along `d` with as little inner angle as possible.
std::vector<Vec3> ways(const SignedAxis& up, Vec3 d) {
    for (double& x : d) x *= up.sign;
    constexpr double kPole = 1e-12;
    std::vector<Vec3> result;
    const double flat = std::hypot(d[0], d[1]);
    const auto add = [&](double alpha, double beta, double gamma) {
        result.push_back({wrapped_deg(alpha / kRadPerDeg), wrapped_deg(beta / kRadPerDeg),
                          wrapped_deg(gamma / kRadPerDeg)});
    };
    constexpr double pi = std::numbers::pi;
    switch (up.axis) {
        case 0: {  // u = (cg cb, sg cb, -sb): only the inner gimbal leaves the x-y plane
            const double beta = std::asin(std::clamp(-d[2], -1.0, 1.0));
            const double gamma = flat > kPole ? std::atan2(d[1], d[0]) : 0;
            add(0, beta, gamma);
            add(0, pi - beta, gamma + pi);
            break;
        }
        case 1: {  // inner angle 0: u = (-sg ca, cg ca, sa)
            const double alpha = std::asin(std::clamp(d[2], -1.0, 1.0));
            const double gamma = flat > kPole ? std::atan2(-d[0], d[1]) : 0;
            add(alpha, 0, gamma);
            add(pi - alpha, 0, gamma + pi);
            break;
        }
        default: {  // inner angle 0: u = (sg sa, -cg sa, ca)
            const double alpha = std::acos(std::clamp(d[2], -1.0, 1.0));
            const double gamma = flat > kPole ? std::atan2(d[0], -d[1]) : 0;
            add(alpha, 0, gamma);
            add(-alpha, 0, gamma + pi);
        }
    }
    return result;
}

}  // namespace

Vec3 attitude_of(const Settings& settings, const Vec3& position_deg) {
    Vec3 gimbal = gimbal_deg(settings, position_deg);
    for (double& angle : gimbal) angle = wrapped_deg(angle);
    return gimbal;
}

Vec3 position_of(const Settings& settings, const Vec3& gimbal_deg) {
    Vec3 position = encoder_deg(settings, gimbal_deg);
    for (double& angle : position) angle = wrapped_deg(angle);
    return position;
}

Vec3 up_at(const Settings& settings, const Vec3& position_deg) {
    const Vec3 gimbal = gimbal_deg(settings, position_deg);
    const Eigen::Vector3d angles(gimbal[0] * kRadPerDeg, gimbal[1] * kRadPerDeg,
                                 gimbal[2] * kRadPerDeg);
    const Eigen::Vector3d u = Kinematics(settings).pose(angles).up;
    return {u[0], u[1], u[2]};
}

std::vector<Vec3> cube_directions() {
    std::vector<Vec3> result;
    for (int kind = 1; kind <= 3; ++kind) {
        for (int x = 1; x >= -1; --x) {
            for (int y = 1; y >= -1; --y) {
                for (int z = 1; z >= -1; --z) {
                    if (std::abs(x) + std::abs(y) + std::abs(z) != kind) continue;
                    const double n = std::sqrt(kind);
                    result.push_back({x / n, y / n, z / n});
                }
            }
        }
    }
    return result;
}

bool GimbalLimits::allow(const Vec3& position_deg) const {
    for (std::size_t k = 0; k < 3; ++k) {
        if (!within(position_deg[k], low[k], high[k])) return false;
    }
    return std::none_of(forbidden.begin(), forbidden.end(), [&](const Vec3& centre) {
        double away = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            away = std::max(away, std::abs(std::remainder(position_deg[k] - centre[k], 360.0)));
        }
        return away <= forbidden_within;
    });
}

std::optional<Vec3> position_for(const Settings& settings, const Vec3& direction,
                                 const GimbalLimits& limits) {
    for (const Vec3& way : ways(settings.up, direction)) {
        if (std::abs(way[1]) > kLargestInner_deg + kDust) continue;
        const Vec3 position = position_of(settings, way);
        if (limits.allow(position)) return position;
    }
    return std::nullopt;
}

std::vector<Vec3> position_grid(const Settings& settings, double step_deg,
                                const GimbalLimits& limits) {
    std::vector<Vec3> result;
    std::set<std::array<long, 3>> seen;
    std::vector<double> angles;
    for (double a = 0; a < 180 + kDust; a += step_deg) {
        angles.push_back(wrapped_deg(a));
        if (a > 0 && a < 180 - kDust) angles.push_back(wrapped_deg(-a));
    }
    // Inner angle zero first: of several ways to one vertical the simplest is kept.
    for (const double beta : angles) {
        if (std::abs(beta) > kLargestInner_deg) continue;
        for (const double alpha : angles) {
            for (const double gamma : angles) {
                const Vec3 position = position_of(settings, {alpha, beta, gamma});
                if (!limits.allow(position)) continue;
                const Vec3 u = up_at(settings, position);
                if (seen.insert({std::lround(u[0] * 1e6), std::lround(u[1] * 1e6),
                                 std::lround(u[2] * 1e6)})
                        .second) {
                    result.push_back(position);
                }
            }
        }
    }
    return result;
}

}  // namespace vibrig::estimator::plan
