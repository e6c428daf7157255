#include "tests/unit/estimator/rig_simulator.hpp"

#include <cmath>

namespace vibrig::estimator::testing {
namespace {

constexpr double kArcsec = 3600.0 / kRad;
using Vec = std::array<double, 3>;
using Mat = std::array<Vec, 3>;

Mat times(const Mat& a, const Mat& b) {
    Mat c{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            for (std::size_t k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
    return c;
}

Vec times(const Mat& a, const Vec& v) {
    Vec c{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) c[i] += a[i][k] * v[k];
    return c;
}

/// Reference (north, up, east) to platform, as a product of three rotations.
Mat to_platform(const Vec& angle) {
    const double a = angle[0], b = angle[1], g = angle[2];
    const Mat x{{{1, 0, 0}, {0, std::cos(a), -std::sin(a)}, {0, std::sin(a), std::cos(a)}}};
    const Mat y{{{std::cos(b), 0, std::sin(b)}, {0, 1, 0}, {-std::sin(b), 0, std::cos(b)}}};
    const Mat z{{{std::cos(g), -std::sin(g), 0}, {std::sin(g), std::cos(g), 0}, {0, 0, 1}}};
    return times(z, times(y, x));
}

/// Angle rates from the platform's rotation: solve [e_alpha e_beta e_gamma] rates = -w by Cramer's
/// rule.
Vec angle_rates(const Vec& angle, const Vec& w) {
    const double b = angle[1], g = angle[2];
    const Vec ea{std::cos(g) * std::cos(b), std::sin(g) * std::cos(b), -std::sin(b)};
    const Vec eb{-std::sin(g), std::cos(g), 0};
    const Vec eg{0, 0, 1};
    const auto det = [](const Vec& p, const Vec& q, const Vec& r) {
        return p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) +
               p[2] * (q[0] * r[1] - q[1] * r[0]);
    };
    const Vec v{-w[0], -w[1], -w[2]};
    const double d = det(ea, eb, eg);
    return {det(v, eb, eg) / d, det(ea, v, eg) / d, det(ea, eb, v) / d};
}

/// Vibration along the vertical and its integrals over a step: a (sin wt + e sin 2wt).
struct Shaking {
    double a, e, w;
    [[nodiscard]] double at(double t) const {
        return a * (std::sin(w * t) + e * std::sin(2 * w * t));
    }
    /// Mean of (1 + A1) and of (1 + A1)^2 over [t, t + dt].
    [[nodiscard]] std::array<double, 2> means(double t, double dt) const {
        if (a == 0) return {1, 1};
        double k1 = 0, k2 = 0;
        constexpr int kSteps = 12;
        for (int i = 0; i < kSteps; ++i) {
            const double f = 1 + at(t + dt * (i + 0.5) / kSteps);
            k1 += f / kSteps;
            k2 += f * f / kSteps;
        }
        return {k1, k2};
    }
};

/// Vibration A1 along `v` on top of gravity along `u`; k1, k2: means of 1 + A1 and of its square.
Vec gyro_drift(const Vec& u, const Vec& v, double k1, double k2,
               const std::array<double, kParameters>& p) {
    const double a = k1 - 1, aa = k2 - 2 * k1 + 1;
    Vec drift{};
    for (std::size_t j = 0; j < 3; ++j) {
        const std::size_t i = j, o = (j + 1) % 3, s = (j + 2) % 3;
        const auto force = [&](std::size_t x) { return u[x] + a * v[x]; };
        const auto both = [&](std::size_t x, std::size_t y) {
            return u[x] * u[y] + a * (u[x] * v[y] + v[x] * u[y]) + aa * v[x] * v[y];
        };
        const double* d = &p[10 * j];  // F I O S II OO SS IO IS OS
        drift[j] = d[0] + d[1] * force(i) + d[2] * force(o) + d[3] * force(s) + d[4] * both(i, i) +
                   d[5] * both(o, o) + d[6] * both(s, s) + d[7] * both(i, o) + d[8] * both(i, s) +
                   d[9] * both(o, s);
    }
    return drift;
}

}  // namespace

const std::array<std::array<double, 3>, 14> kTable1{{{0, 0, 0},
                                                     {0, 0, 45},
                                                     {0, 0, 90},
                                                     {0, 0, 180},
                                                     {180, 0, 45},
                                                     {45, 0, 0},
                                                     {45, 0, 90},
                                                     {90, 0, 90},
                                                     {90, 0, 180},
                                                     {180, 0, 270},
                                                     {270, 0, 0},
                                                     {270, 0, 90},
                                                     {-45, 0, 0},
                                                     {-45, 0, 90}}};

const std::array<double, kParameters> kTable2{
    1,  -1, -1, 1,  0.03,  0.03,  -0.03, 0.03,  -0.03, -0.03,  //
    -1, 1,  1,  -1, -0.03, -0.03, 0.03,  -0.03, 0.03,  0.03,   //
    1,  -1, -1, 1,  0.03,  0.03,  -0.03, 0.03,  -0.03, -0.03};

double RigSimulator::averaged(History& history, std::size_t axis, std::size_t n,
                              std::size_t count) {
    if (count == 1) return gauss();
    std::array<double, kMostAveraged>& draws = history[axis];
    draws[n % count] = gauss();
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += draws[i] / static_cast<double>(count);
    return sum;
}

DwellSummary RigSimulator::dwell(Identification& to, const SimulatedDwell& plan) {
    const double omega = 15.041067, latitude = 45.75 * kRad;
    const Vec earth{omega * std::cos(latitude), omega * std::sin(latitude), 0};
    const double lsb = 2 * 180 * kRad / 1048576.0;
    const double dt = plan.period_s;
    const double walk = 60 * random_walk_deg_per_rt_h * std::sqrt(dt);  // arcsec per step
    Shaking shaking{plan.amplitude_g, plan.second_harmonic, 2 * 180 * kRad * plan.frequency_hz};
    const bool late = plan.info.run == 1 && plan.info.position == plan.late_position;
    const double start = uniform_(random_);
    Vec angle{plan.angles_deg[0] * kRad, plan.angles_deg[1] * kRad, plan.angles_deg[2] * kRad};

    to.begin_dwell(plan.info);
    const auto steps = static_cast<int>(std::lround(plan.duration_s / dt));
    for (int n = 0; n < steps; ++n) {
        const double t = start + n * dt;
        shaking.a = plan.amplitude_g * (1 + plan.amplitude_drift * n / steps);
        if (late && n * dt < plan.late_s) shaking.a = 0;
        const Mat c = to_platform(angle);
        const Vec u = times(c, Vec{0, 1, 0});
        const Vec shaken = times(c, Vec{plan.cross_north, 1, plan.cross_east});
        Measurement m;
        m.time_s = n * dt;
        for (std::size_t k = 0; k < 3; ++k) {
            double reading = angle[k] + resolver_arcsec / kArcsec *
                                            averaged(encoder_noise_, k, static_cast<std::size_t>(n),
                                                     encoder_average);
            if (uniform_(random_) < plan.spike_probability) reading += 0.5 * kRad;
            if (quantise) reading = lsb * std::round(reading / lsb);
            const double turn = 360 * kRad;
            m.angle_rad[k] = reading - turn * std::floor(reading / turn);
            m.force_g[k] =
                plan.force_scale * (u[k] + shaken[k] * shaking.at(t)) + force_noise_g * gauss();
        }
        if (spoil) spoil(plan.info, n, m);
        if (uniform_(random_) >= plan.lost_probability) to.add(m);

        const std::array<double, 2> k12 = shaking.means(t, dt);
        const Vec drift = gyro_drift(u, shaken, k12[0], k12[1], truth);
        const Vec we = times(c, earth);
        Vec turn{};  // arcsec
        for (std::size_t j = 0; j < 3; ++j)
            turn[j] = dt * (-drift[j] - we[j]) +
                      walk * averaged(gyro_noise_, j, static_cast<std::size_t>(n), gyro_average);
        const Vec change = angle_rates(angle, turn);
        for (std::size_t k = 0; k < 3; ++k) angle[k] += change[k] / kArcsec;
    }
    return to.end_dwell();
}

void RigSimulator::campaign(Identification& to, std::array<double, 2> amplitudes_g,
                            SimulatedDwell plan) {
    for (std::size_t run = 0; run < 2; ++run) {
        for (std::size_t p = 0; p < kTable1.size(); ++p) {
            plan.info.run = static_cast<int>(run) + 1;
            plan.info.position = static_cast<int>(p) + 1;
            plan.angles_deg = kTable1[p];
            plan.amplitude_g = amplitudes_g[run];
            dwell(to, plan);
        }
    }
}

}  // namespace vibrig::estimator::testing
