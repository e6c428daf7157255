// Gravity against encoders for one class of descriptions after the other: a grid over the zeros of
// the outer and inner gimbal, where all else is linear, refined; then the accelerometers as a
// signed permutation that is nearly square and all 16 parameters with what is believed of them.
#include "estimator/commissioning/gravity_fit.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::commissioning {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStepOuter = 9 * kRadPerDeg, kStepInner = 12 * kRadPerDeg;
constexpr std::size_t kNodes = 3;
/// Of twice the ln ratio: what is this far beyond the best needs no closer look.
constexpr double kFarBeyond = 120;
/// sigma of a matrix element that nothing is believed of.
constexpr double kFree = 30;

/// The stops as one class sees them: angles but for the zeros, rad.
struct Class {
    Description names;
    std::vector<Vector3d> angle, force;
};

Class class_of(const std::vector<Stop>& stops, const Description& names) {
    Class c;
    c.names = names;
    c.names.zero_deg = {};
    for (const Stop& stop : stops) {
        c.angle.push_back(c.names.angles(stop.reading));
        c.force.emplace_back(stop.force[0], stop.force[1], stop.force[2]);
    }
    return c;
}

/// Zeros of the outer and inner gimbal and elevation of the outer axis, rad.
using Bend = Vector3d;

struct Linear {
    Eigen::Matrix<double, 4, 3> solution;  ///< matrix' and zeros
    double cost = 0;                       ///< -2 ln posterior, constant left out
};

/// Matrix and zeros of the accelerometers by least squares, given the rest.
Linear solve_linear(const Class& c, const Bend& bend, const GravitySettings& s) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Matrix<double, 4, 3> right = Eigen::Matrix<double, 4, 3>::Zero();
    double all = 0;
    for (std::size_t n = 0; n < c.angle.size(); ++n) {
        const Vector3d& a = c.angle[n];
        Eigen::Vector4d row;
        row << up_at({a[0] - bend[0], a[1] - bend[1], a[2]}, bend[2]), 1;
        normal += row * row.transpose();
        right += row * c.force[n].transpose();
        all += c.force[n].squaredNorm();
    }
    const double variance = s.force_sigma_g * s.force_sigma_g;
    for (int i = 0; i < 3; ++i) normal(i, i) += variance / (kFree * kFree);
    normal(3, 3) += variance / (s.zero_sigma_g * s.zero_sigma_g);
    Linear result;
    result.solution = linear_algebra::PivotedCholesky(normal).solve(right);
    const double rest = std::max(0.0, all - right.cwiseProduct(result.solution).sum());
    const double lean = bend[2] / (s.elevation_sigma_deg * kRadPerDeg);
    result.cost = rest / variance + lean * lean;
    return result;
}

/// Of the circle the middle of an arc that holds all the angles, and its half width, rad.
std::pair<double, double> arc_of(std::vector<double> angles) {
    std::ranges::sort(angles);
    double gap = angles.front() + 2 * kPi - angles.back(), from = angles.front(),
           to = angles.back();
    for (std::size_t i = 1; i < angles.size(); ++i) {
        if (angles[i] - angles[i - 1] <= gap) continue;
        gap = angles[i] - angles[i - 1];
        from = angles[i];
        to = angles[i - 1] + 2 * kPi;
    }
    return {0.5 * (from + to), 0.5 * (to - from)};
}

/// Best nodes of the grid: inner zeros with which no stop has the inner gimbal beyond 80 deg.
std::vector<std::pair<double, Bend>> best_nodes(const Class& c, const GravitySettings& s) {
    std::vector<double> inner;
    for (const auto& a : c.angle) inner.push_back(a[1]);
    const auto [middle, half] = arc_of(inner);
    const double room = kMaxInnerAngleRad - half;
    std::vector<std::pair<double, Bend>> nodes;
    if (room < 0) return nodes;
    const int steps = static_cast<int>(std::ceil(room / kStepInner));
    for (int j = -steps; j <= steps; ++j) {
        const double zero = middle + (steps == 0 ? 0 : j * room / steps);
        for (double outer = 0; outer < kPi - 1e-9; outer += kStepOuter) {
            const Bend bend(outer, zero, 0);
            nodes.emplace_back(solve_linear(c, bend, s).cost, bend);
        }
    }
    const auto kept = std::min(kNodes, nodes.size());
    std::ranges::partial_sort(nodes, nodes.begin() + static_cast<std::ptrdiff_t>(kept), {},
                              [](const auto& node) { return node.first; });
    nodes.resize(kept);
    return nodes;
}

/// Gauss-Newton on the projected residual, damped.
std::pair<double, Bend> refine(const Class& c, Bend bend, const GravitySettings& s) {
    const std::size_t n = c.angle.size();
    const auto residual = [&](const Bend& at, VectorXd& r) {
        const Linear linear = solve_linear(c, at, s);
        for (std::size_t k = 0; k < n; ++k) {
            const Vector3d& a = c.angle[k];
            Eigen::Vector4d row;
            row << up_at({a[0] - at[0], a[1] - at[1], a[2]}, at[2]), 1;
            r.segment<3>(static_cast<Eigen::Index>(3 * k)) =
                (c.force[k] - linear.solution.transpose() * row) / s.force_sigma_g;
        }
        r[static_cast<Eigen::Index>(3 * n)] = at[2] / (s.elevation_sigma_deg * kRadPerDeg);
        return linear.cost;
    };
    const auto rows = static_cast<Eigen::Index>(3 * n + 1);
    VectorXd r(rows), moved(rows);
    MatrixXd j(rows, 3);
    double cost = residual(bend, r), damping = 1e-3;
    for (int turn = 0; turn < 12; ++turn) {
        constexpr double kStep = 1e-5;
        for (int k = 0; k < 3; ++k) {
            Bend at = bend;
            at[k] += kStep;
            static_cast<void>(residual(at, moved));
            j.col(k) = (moved - r) / kStep;
        }
        Matrix3d damped = linear_algebra::gram(j);
        damped.diagonal() *= 1 + damping;
        const Bend step = -linear_algebra::PivotedCholesky(damped).solve(j.transpose() * r);
        const double next = residual(bend + step, moved);
        if (!(next < cost)) {
            damping *= 10;
            if (damping > 1e6) break;
            continue;
        }
        const bool done = cost - next < 1e-3;
        bend += step;
        cost = next;
        r = moved;
        damping = std::max(damping / 10, 1e-9);
        if (done) break;
    }
    return {cost, bend};
}

/// All that a class leaves open: zeros of the three gimbals, elevation, zeros of the
/// accelerometers, error of their matrix by rows.
constexpr int kOuter = 0, kInner = 1, kAzimuth = 2, kElevation = 3, kZeros = 4, kErrors = 7,
              kAll = 16;
using Full = Eigen::Matrix<double, kAll, 1>;

Vector3d up_of(const Class& c, std::size_t n, const Full& p) {
    const Vector3d& a = c.angle[n];
    return up_at({a[0] - p[kOuter], a[1] - p[kInner], a[2] - p[kAzimuth]}, p[kElevation]);
}

Matrix3d error_of(const Full& p) {
    Matrix3d e;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) e(i, k) = p[kErrors + 3 * i + k];
    return e;
}

/// Of the 48 and a turn about the azimuth axis the nearest to a free matrix.
std::pair<Matrix3d, double> structure_of(const Matrix3d& free) {
    Matrix3d best = Matrix3d::Identity();
    double best_turn = 0, least = HUGE_VAL;
    for (const Matrix3d& s : signed_permutations()) {
        const Matrix3d m = s.transpose() * free;  // = (I + E) Rot(-zc)
        // The trace of m Rot(zc) is greatest at
        const double turn = std::atan2(m(0, 1) - m(1, 0), m(0, 0) + m(1, 1));
        const double c = std::cos(turn), t = std::sin(turn);
        Matrix3d rot;
        rot << c, -t, 0, t, c, 0, 0, 0, 1;
        const double off = (m * rot - Matrix3d::Identity()).norm();
        // Four of the 48 are equal but for quarter turns: the smallest turn of them.
        if (off > least + 1e-9 ||
            (off > least - 1e-9 && std::abs(turn) >= std::abs(best_turn) - 1e-9))
            continue;
        least = off;
        best = s;
        best_turn = turn;
    }
    return {best, best_turn};
}

struct Structured {
    double cost = 0, rms_g = 0;
    Full p = Full::Zero();
    Matrix3d wiring = Matrix3d::Identity();
};

Full prior_sigma(const GravitySettings& s) {
    Full sigma = Full::Constant(HUGE_VAL);
    sigma[kElevation] = s.elevation_sigma_deg * kRadPerDeg;
    sigma.segment<3>(kZeros).setConstant(s.zero_sigma_g);
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            sigma[kErrors + 3 * i + k] =
                i == k ? s.gain_sigma : s.misalignment_sigma_arcmin / 60 * kRadPerDeg;
    return sigma;
}

double cost_at(const Class& c, const Matrix3d& wiring, const Full& p, const Full& sigma,
               double force_sigma_g, double* rms_g) {
    const Matrix3d a = wiring * (Matrix3d::Identity() + error_of(p));
    double sum = 0;
    for (std::size_t n = 0; n < c.angle.size(); ++n)
        sum += (c.force[n] - a * up_of(c, n, p) - p.segment<3>(kZeros)).squaredNorm();
    if (rms_g != nullptr) *rms_g = std::sqrt(sum / static_cast<double>(3 * c.angle.size()));
    double cost = sum / (force_sigma_g * force_sigma_g);
    for (int i = kElevation; i < kAll; ++i) cost += p[i] * p[i] / (sigma[i] * sigma[i]);
    return cost;
}

/// One damped Gauss-Newton step's normal equations.
void linearise(const Class& c, const Matrix3d& wiring, const Full& p, const Full& sigma,
               double force_sigma_g, Eigen::Matrix<double, kAll, kAll>& normal, Full& gradient) {
    const Matrix3d a = wiring * (Matrix3d::Identity() + error_of(p));
    const double weight = 1 / (force_sigma_g * force_sigma_g);
    normal.setZero();
    gradient.setZero();
    for (std::size_t n = 0; n < c.angle.size(); ++n) {
        const Vector3d u = up_of(c, n, p);
        const Vector3d r = c.force[n] - a * u - p.segment<3>(kZeros);
        Eigen::Matrix<double, 3, kAll> h;
        for (int k = 0; k < 4; ++k) {
            constexpr double kStep = 1e-6;
            Full moved = p;
            moved[k] += kStep;
            h.col(k) = a * (up_of(c, n, moved) - u) / kStep;
        }
        h.middleCols<3>(kZeros).setIdentity();
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) h.col(kErrors + 3 * i + k) = wiring.col(i) * u[k];
        normal += weight * h.transpose() * h;
        gradient += weight * h.transpose() * r;
    }
    for (int i = kElevation; i < kAll; ++i) {
        const double w = 1 / (sigma[i] * sigma[i]);
        normal(i, i) += w;
        gradient[i] -= w * p[i];
    }
}

Structured fit_structure(const Class& c, const Bend& bend, const GravitySettings& s) {
    const Linear linear = solve_linear(c, bend, s);
    const Matrix3d free = linear.solution.topRows<3>().transpose();
    Structured fit;
    const auto [wiring, turn] = structure_of(free);
    fit.wiring = wiring;
    const Full sigma = prior_sigma(s);
    fit.p[kOuter] = bend[0];
    fit.p[kInner] = bend[1];
    fit.p[kAzimuth] = turn;
    fit.p[kElevation] = bend[2];
    fit.p.segment<3>(kZeros) = linear.solution.row(3).transpose();
    fit.cost = cost_at(c, wiring, fit.p, sigma, s.force_sigma_g, &fit.rms_g);
    double damping = 1e-6;
    Eigen::Matrix<double, kAll, kAll> normal;
    Full gradient;
    for (int round = 0; round < 20; ++round) {
        linearise(c, wiring, fit.p, sigma, s.force_sigma_g, normal, gradient);
        normal.diagonal() *= 1 + damping;
        const Full moved = fit.p + linear_algebra::PivotedCholesky(normal).solve(gradient);
        double rms = 0;
        const double cost = cost_at(c, wiring, moved, sigma, s.force_sigma_g, &rms);
        if (!(cost < fit.cost)) {
            if (damping > 1e3) break;
            damping *= 10;
            continue;
        }
        const bool done = fit.cost - cost < 1e-3;
        fit.p = moved;
        fit.cost = cost;
        fit.rms_g = rms;
        damping /= 10;
        if (done) break;
    }
    return fit;
}

Description describe(const Class& c, const Structured& fit) {
    Description d = c.names;
    for (int k = 0; k < 3; ++k)
        d.zero_deg[static_cast<std::size_t>(k)] =
            std::remainder(d.sign[static_cast<std::size_t>(k)] * fit.p[k] / kRadPerDeg, 360.0);
    d.elevation_deg = fit.p[kElevation] / kRadPerDeg;
    d.accelerometers = fit.wiring * (Matrix3d::Identity() + error_of(fit.p));
    d.zero_g = fit.p.segment<3>(kZeros);
    return d;
}

struct Candidate {
    Class c;
    Bend bend = Bend::Zero();
    double least = 0;  ///< of its cost
    bool fitted = false;
    Structured fit;
    [[nodiscard]] double cost() const { return fitted ? fit.cost : least; }
};

std::optional<Candidate> candidate(const std::vector<Stop>& stops, const Description& names,
                                   const GravitySettings& settings) {
    Candidate one;
    one.c = class_of(stops, names);
    one.least = HUGE_VAL;
    for (const auto& [cost, bend] : best_nodes(one.c, settings)) {
        const auto [refined, at] = refine(one.c, bend, settings);
        if (refined >= one.least) continue;
        one.least = refined;
        one.bend = at;
    }
    if (!std::isfinite(one.least)) return std::nullopt;
    return one;
}

}  // namespace

std::vector<Hypothesis> fit_classes(const std::vector<Stop>& stops,
                                    const std::array<std::vector<int>, 3>& units,
                                    const GravitySettings& settings) {
    std::vector<Candidate> all;
    std::array<int, 3> channel{0, 1, 2};
    do {
        const auto& outer = units[static_cast<std::size_t>(channel[0])];
        const auto& inner = units[static_cast<std::size_t>(channel[1])];
        const auto& azimuth = units[static_cast<std::size_t>(channel[2])];
        for (const int product : {1, -1})
            for (const int u0 : outer)
                for (const int u1 : inner)
                    for (const int u2 : azimuth) {
                        Description names;
                        names.channel = channel;
                        names.unit = {u0, u1, u2};
                        names.sign = {1, 1, product};
                        if (auto one = candidate(stops, names, settings))
                            all.push_back(std::move(*one));
                    }
    } while (std::ranges::next_permutation(channel).found);
    std::ranges::sort(all, {}, &Candidate::least);
    double best = HUGE_VAL;
    for (Candidate& one : all) {
        if (one.least > best + kFarBeyond) break;
        one.fit = fit_structure(one.c, one.bend, settings);
        one.fitted = true;
        best = std::min(best, one.fit.cost);
    }
    std::ranges::stable_sort(all, {}, &Candidate::cost);
    std::vector<Hypothesis> hypotheses;
    for (const Candidate& one : all) {
        const auto fit = one.fitted ? one.fit : fit_structure(one.c, one.bend, settings);
        hypotheses.push_back({describe(one.c, fit), one.cost(), fit.rms_g,
                              -0.5 * (one.cost() - all.front().cost())});
        if (hypotheses.size() == 3) break;  // the next is what is reported
    }
    return hypotheses;
}

}  // namespace vibrig::estimator::commissioning
