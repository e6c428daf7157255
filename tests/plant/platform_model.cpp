#include "tests/plant/platform_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::plant {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kRadPerSecondOfDegPerHour = kRadPerDeg / 3600;
constexpr double kEarthRate = 15.041067;  ///< deg/h

double along(const Vec3& v, const Axis& axis) noexcept {
    return axis.sign * v[static_cast<std::size_t>(axis.index)];
}

/// A vector turned about a unit axis, Rodrigues.
Vec3 turned(const Vec3& v, const Vec3& axis, double angle) noexcept {
    const double c = std::cos(angle);
    return c * v + std::sin(angle) * cross(axis, v) + (1 - c) * dot(axis, v) * axis;
}

}  // namespace

PlatformModel::PlatformModel(const Truth& truth)
    : shape_(truth),
      elasticity_(truth),
      coefficients_(truth.coefficients),
      cubic_(truth.cubic_deg_h_g3),
      gyro_axes_(truth.gyro_axes),
      drift_sign_(truth.drift_sign) {
    // The base leans: what is level and upright is seen turned the other way, first about north.
    const Frame base(truth);
    const double about_north = -truth.base_tilt_deg[0] * kRadPerDeg;
    const double about_east = -truth.base_tilt_deg[1] * kRadPerDeg;
    const auto leaning = [&](const Vec3& v) {
        const Vec3 once = turned(v, base.north, about_north);
        return turned(once, base.east, about_east);
    };
    up_ = leaning(base.up);
    const double latitude = truth.latitude_deg * kRadPerDeg;
    const double azimuth = truth.azimuth_deg * kRadPerDeg;
    earth_ = leaning(kEarthRate * (std::cos(latitude) * (std::cos(azimuth) * base.north -
                                                         std::sin(azimuth) * base.east) +
                                   std::sin(latitude) * base.up));
    for (std::size_t i = 0; i < 2; ++i) {
        const double angle = truth.non_orthogonality_arcsec[i] * kRadPerDeg / 3600;
        skew_[i] = {std::sin(angle), std::cos(angle)};
    }
}

Vec3 PlatformModel::to_platform(const Vec3& angles, const Vec3& reference) noexcept {
    // The reference vector as seen after each gimbal in turn: outer about x, inner about y, azimuth
    // about z.
    const double ca = std::cos(angles[0]), sa = std::sin(angles[0]);
    const double cb = std::cos(angles[1]), sb = std::sin(angles[1]);
    const double cg = std::cos(angles[2]), sg = std::sin(angles[2]);
    const Vec3 outer{reference[0], ca * reference[1] - sa * reference[2],
                     sa * reference[1] + ca * reference[2]};
    const Vec3 inner{cb * outer[0] + sb * outer[2], outer[1], cb * outer[2] - sb * outer[0]};
    return {cg * inner[0] - sg * inner[1], sg * inner[0] + cg * inner[1], inner[2]};
}

PlatformModel::Turn::Turn(const Vec3& angles) noexcept
    : ca(std::cos(angles[0])),
      sa(std::sin(angles[0])),
      cb(std::cos(angles[1])),
      sb(std::sin(angles[1])),
      cg(std::cos(angles[2])),
      sg(std::sin(angles[2])) {}

PlatformModel::Turn PlatformModel::Turn::further(const Vec3& by) const noexcept {
    constexpr double kFar = 1e-4;  // what the series leaves out is 1e-22 there
    Turn out = *this;
    const auto turn = [](double& c, double& s, double angle) {
        const bool far = std::abs(angle) > kFar;
        const double square = angle * angle;
        const double sine = far ? std::sin(angle) : angle - angle * square / 6;
        const double versine = far ? 1 - std::cos(angle) : square / 2 - square * square / 24;
        const double before = c;
        c -= versine * c + sine * s;
        s -= versine * s - sine * before;
    };
    turn(out.ca, out.sa, by[0]);
    turn(out.cb, out.sb, by[1]);
    turn(out.cg, out.sg, by[2]);
    return out;
}

Vec3 PlatformModel::seen(const Turn& turn, const Vec3& r) const noexcept {
    // Gimbal by gimbal as above, with what is not square between them.
    const auto& [ca, sa, cb, sb, cg, sg] = turn;
    const auto& [first, second] = skew_;
    const double y = ca * r[1] - sa * r[2];
    const Vec3 outer{first.cosine * r[0] - first.sine * y, first.sine * r[0] + first.cosine * y,
                     sa * r[1] + ca * r[2]};
    const double z = cb * outer[2] - sb * outer[0];
    const Vec3 inner{cb * outer[0] + sb * outer[2], second.cosine * outer[1] - second.sine * z,
                     second.sine * outer[1] + second.cosine * z};
    return {cg * inner[0] - sg * inner[1], sg * inner[0] + cg * inner[1], inner[2]};
}

Vec3 PlatformModel::drift_under(const Moments& force) const noexcept {
    Vec3 drift{};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const GyroCoefficients& d = coefficients_[gyro];
        const auto& axes = gyro_axes_[gyro];
        const auto second = [&](std::size_t a, std::size_t b) {
            const auto [low, high] = std::minmax(axes[a].index, axes[b].index);
            return axes[a].sign * axes[b].sign *
                   force.second[static_cast<std::size_t>(low)][static_cast<std::size_t>(high)];
        };
        drift[gyro] = d[kF] + d[kIO] * second(0, 1) + d[kIS] * second(0, 2) + d[kOS] * second(1, 2);
        for (std::size_t a = 0; a < 3; ++a) {
            drift[gyro] += d[kI + a] * along(force.first, axes[a]) + d[kII + a] * second(a, a) +
                           cubic_[gyro][a] * along(force.third, axes[a]);
        }
    }
    return drift;
}

Vec3 PlatformModel::force(const Shake& shake, double gain) const noexcept {
    const Vec3 still = seen(here_, up_ + gain * shape_.acceleration(shake));
    if (!shape_.platform_rocks()) return still;
    return still - cross(shape_.platform_turn(shake), still);
}

Vec3 PlatformModel::rocking(const Shake& shake) const noexcept {
    if (!shape_.platform_rocks() && !shape_.base_rocks()) return {};
    // A base that turns one way is a platform that turns the other way, seen from the base.
    return gimbal_turn(here_, shape_.platform_turn(shake) - seen(here_, shape_.base_turn(shake)));
}

Vec3 PlatformModel::gimbal_turn(const Turn& at, const Vec3& turn) const noexcept {
    // The gimbals turn base against platform: turn = -(alpha outer + beta inner + gamma azimuth
    // axis). Seen before the azimuth gimbal's turn the azimuth axis is z, the inner axis is y but
    // for what is not square, and the outer axis leans by beta out of the level plane. So what is
    // along x is due to the outer gimbal alone, what is left along y to the inner one, and the rest
    // to the azimuth gimbal.
    const double cb = at.cb, sb = at.sb, cg = at.cg, sg = at.sg;
    const auto& [first, second] = skew_;
    const Vec3 outer{cb * first.cosine,
                     second.cosine * first.sine + second.sine * sb * first.cosine,
                     second.sine * first.sine - second.cosine * sb * first.cosine};
    const double alpha = -(cg * turn[0] + sg * turn[1]) / outer[0];
    const double beta = (sg * turn[0] - cg * turn[1] - alpha * outer[1]) / second.cosine;
    const double gamma = -turn[2] - alpha * outer[2] - beta * second.sine;
    return {alpha, beta, gamma};
}

Vec3 PlatformModel::rates_of(const Turn& at, const Vec3& rate) const noexcept {
    // Relative to the Earth the Earth's own rate comes off.
    return kRadPerSecondOfDegPerHour * gimbal_turn(at, rate - seen(at, earth_));
}

template <bool kThird>
PlatformModel::Powers PlatformModel::powers(std::span<const Shake> shakes) noexcept {
    // Simpson's rule: ends once, odd ones four times, even ones twice. x and y side by side.
    typedef double Pair __attribute__((vector_size(16)));
    struct Sums {
        Pair first{}, by_x{}, by_y{}, by_xx{}, by_yy{};
        void add(const Shake& shake) noexcept {
            const Pair v{shake.in_phase, shake.quadrature};
            const Pair x = shake.in_phase * v, y = shake.quadrature * v;
            first += v;
            by_x += x;
            by_y += y;
            if constexpr (kThird) {
                by_xx += shake.in_phase * x;
                by_yy += shake.quadrature * y;
            }
        }
    };
    Sums ends, odd, even;
    const std::size_t last = shakes.size() - 1;
    ends.add(shakes[0]);
    double scale = 1;
    if (last > 0) {
        ends.add(shakes[last]);
        odd.add(shakes[1]);
        for (std::size_t i = 2; i < last; i += 2) {
            even.add(shakes[i]);
            odd.add(shakes[i + 1]);
        }
        scale = 1 / (3.0 * static_cast<double>(last));
    }
    const auto mean = [&](Pair Sums::*sum) {
        return scale * (ends.*sum + 4.0 * (odd.*sum) + 2.0 * (even.*sum));
    };
    const Pair first = mean(&Sums::first), by_x = mean(&Sums::by_x), by_y = mean(&Sums::by_y);
    const Pair by_xx = mean(&Sums::by_xx), by_yy = mean(&Sums::by_yy);
    return {first[0], first[1], by_x[0], by_x[1], by_y[1], by_xx[0], by_xx[1], by_yy[0], by_yy[1]};
}

PlatformModel::Moments PlatformModel::swept(const Vec3& up, const Vec3& a, const Vec3& b,
                                            const Powers& powers) noexcept {
    const auto& [p, q, pp, pq, qq, ppp, ppq, pqq, qqq] = powers;
    Moments out;
    for (std::size_t i = 0; i < 3; ++i) {
        const double u = up[i], ai = a[i], bi = b[i];
        out.first[i] = u + p * ai + q * bi;
        out.third[i] = u * u * u + 3 * u * u * (p * ai + q * bi) +
                       3 * u * (pp * ai * ai + 2 * pq * ai * bi + qq * bi * bi) +
                       ppp * ai * ai * ai + 3 * ppq * ai * ai * bi + 3 * pqq * ai * bi * bi +
                       qqq * bi * bi * bi;
        for (std::size_t j = i; j < 3; ++j) {
            out.second[i][j] = u * up[j] + p * (u * a[j] + ai * up[j]) +
                               q * (u * b[j] + bi * up[j]) + pp * ai * a[j] +
                               pq * (ai * b[j] + bi * a[j]) + qq * bi * b[j];
        }
    }
    return out;
}

Vec3 PlatformModel::mean_rate(const Turn& at, double dt_s,
                              std::span<const Shake> shakes) const noexcept {
    // The loop holds the gyro outputs at zero, so the platform turns against its drift in inertial
    // space: drift_sign. Simpson's rule over the powers of the force, of which the drift is made.
    const Vec3 up = seen(at, up_);
    const Vec3 along_axis = seen(at, shape_.acceleration({1, 0}));
    const Vec3 ahead_axis = seen(at, shape_.acceleration({0, 1}));
    if (!shape_.platform_rocks()) {
        const Powers mean = cubic_ == Mat3{} ? powers<false>(shakes) : powers<true>(shakes);
        return drift_sign_ * drift_under(swept(up, along_axis, ahead_axis, mean));
    }
    const double third = 1 / (3.0 * static_cast<double>(shakes.size() - 1));
    const auto weight = [&](std::size_t i) {
        const bool end = i == 0 || i + 1 == shakes.size();
        return shakes.size() == 1 ? 1 : (end ? 1 : i % 2 == 1 ? 4 : 2) * third;
    };
    Moments moments;
    Vec3 cone{};
    Vec3 before{};
    for (std::size_t i = 0; i < shakes.size(); ++i) {
        Vec3 f = up + shakes[i].in_phase * along_axis + shakes[i].quadrature * ahead_axis;
        const Vec3 turn = shape_.platform_turn(shakes[i]);
        f = f - cross(turn, f);
        // A platform that turns to and fro about two axes at different phases creeps about the
        // third: its gyros feel turn' - turn x turn' / 2, whose mean the loop holds.
        if (i > 0) cone = cone + 0.5 * cross(before, turn);
        before = turn;
        moments.add(weight(i), f);
    }
    return drift_sign_ * drift_under(moments) + (1 / (kRadPerSecondOfDegPerHour * dt_s)) * cone;
}

Vec3 PlatformModel::yielding(const Turn& at, double dt_s, std::span<const Shake> shakes) noexcept {
    const Vec3 a = seen(at, shape_.acceleration({1, 0}));
    const Vec3 b = seen(at, shape_.acceleration({0, 1}));
    const auto excess = elasticity_.advance(dt_s, shakes);
    Vec3 drift{};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const auto& e = excess[gyro];
        const auto& axes = gyro_axes_[gyro];
        const GyroCoefficients& d = coefficients_[gyro];
        const auto second = [&](std::size_t i, std::size_t k) {
            const double ai = along(a, axes[i]), ak = along(a, axes[k]);
            const double bi = along(b, axes[i]), bk = along(b, axes[k]);
            return e.pp * ai * ak + e.pq * (ai * bk + bi * ak) + e.qq * bi * bk;
        };
        const double sum = d[kII] * second(0, 0) + d[kOO] * second(1, 1) + d[kSS] * second(2, 2) +
                           d[kIO] * second(0, 1) + d[kIS] * second(0, 2) + d[kOS] * second(1, 2);
        drift[gyro] = elasticity_.share(gyro) * sum;
    }
    return drift;
}

void PlatformModel::advance(double dt_s, std::span<const Shake> shakes,
                            const Vec3& extra) noexcept {
    const Turn at = here_.further((dt_s / 2) * rates_of(here_, rate_ + extra));
    rate_ = mean_rate(at, dt_s, shakes);
    if (elasticity_.any()) rate_ = rate_ + drift_sign_ * yielding(at, dt_s, shakes);
    set_angles(angles_ + dt_s * rates_of(at, rate_ + extra));
}

}  // namespace vibrig::plant
