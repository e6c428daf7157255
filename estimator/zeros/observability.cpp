#include "estimator/zeros/observability.hpp"

#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/zeros/error_model.hpp"
#include "estimator/zeros/units.hpp"

namespace vibrig::estimator::zeros {
namespace {

constexpr double kRankLimit = 1e-10;
constexpr double kWeakest = 1e-5;
constexpr double kNamed = 0.3;
constexpr double kTimeScale_s = 30;

StateVector scales(const Site& site) {
    StateVector s;
    const double metre = 1 / site.radius_m;
    const double rate = 0.1 * kDegPerHour;
    const double force = 1e-3 * site.gravity_mps2;
    s << 1e-3, 1e-3, 1e-3, 1, 1, 1, metre, metre / std::cos(site.latitude_rad), 1, rate, rate, rate,
        force, force, force;
    return s;
}

/// A basis with as many zeros as it can have, so that its vectors can be named.
Eigen::MatrixXd sparse_basis(Eigen::MatrixXd v) {
    std::array<bool, kStates> used{};
    for (Eigen::Index k = 0; k < v.cols(); ++k) {
        Eigen::Index pivot = -1;
        for (Eigen::Index i = 0; i < v.rows(); ++i) {
            if (!used[static_cast<std::size_t>(i)] &&
                (pivot < 0 || std::abs(v(i, k)) > std::abs(v(pivot, k)))) {
                pivot = i;
            }
        }
        used[static_cast<std::size_t>(pivot)] = true;
        const Eigen::VectorXd column = v.col(k) / v(pivot, k);
        v.col(k) = column;
        for (Eigen::Index other = 0; other < v.cols(); ++other) {
            if (other != k) {
                const double factor = v(pivot, other);
                v.col(other) -= factor * column;
            }
        }
    }
    for (Eigen::Index k = 0; k < v.cols(); ++k) {
        const double norm = v.col(k).norm();
        v.col(k) /= norm;
    }
    return v;
}

}  // namespace

bool Observability::sufficient() const noexcept {
    return rank == kStates && singular[kStates - 1] >= kWeakest;
}

std::string Observability::unobservable() const {
    std::string text;
    for (const auto& vector : null_vectors) {
        std::string names;
        for (std::size_t i = 0; i < vector.size(); ++i) {
            if (std::abs(vector[i]) > kNamed) {
                names += (names.empty() ? "" : " with ") + std::string(kStateNames[i]);
            }
        }
        text += (text.empty() ? "" : "; ") + names;
    }
    return text;
}

Observability observability(const std::vector<double>& azimuths_deg, const Site& site) {
    const StateVector scale = scales(site);
    const MeasurementMatrix h = measurement_matrix(site) * scale.asDiagonal();
    Eigen::MatrixXd som(90 * static_cast<Eigen::Index>(azimuths_deg.size()), kStates);
    Eigen::Index row = 0;
    for (const double azimuth : azimuths_deg) {
        const double psi = azimuth * kRadPerDeg;
        Eigen::Matrix3d c;
        c << std::cos(psi), -std::sin(psi), 0, std::sin(psi), std::cos(psi), 0, 0, 0, 1;
        const StateMatrix a = kTimeScale_s * (scale.cwiseInverse().asDiagonal() *
                                              error_dynamics(c, {0, 0, site.gravity_mps2}, site) *
                                              scale.asDiagonal());
        MeasurementMatrix power = h;
        for (int i = 0; i < kStates; ++i) {
            som.middleRows<6>(row) = power;
            row += 6;
            power = (power * a).eval();
        }
    }
    const auto [s, v] = linear_algebra::right_singular(som);
    Observability result;
    for (Eigen::Index i = 0; i < kStates; ++i) {
        result.singular[static_cast<std::size_t>(i)] = s[i];
        result.rank += s[i] > kRankLimit * s[0] ? 1 : 0;
    }
    const Eigen::Index missing = kStates - result.rank;
    for (Eigen::Index j = 0; j < kStates; ++j) {
        double row_norm = 0;
        for (Eigen::Index k = 0; k < result.rank; ++k) {
            row_norm += v(j, k) * v(j, k) / (s[k] * s[k]);
        }
        const bool lost = v.row(j).tail(missing).squaredNorm() > 1e-6;
        result.degree[static_cast<std::size_t>(j)] = lost ? 0 : 1 / std::sqrt(row_norm);
    }
    const Eigen::Index weak =
        missing > 0 ? missing : static_cast<Eigen::Index>(s[kStates - 1] < kWeakest);
    const Eigen::MatrixXd basis = sparse_basis(v.rightCols(weak));
    for (Eigen::Index k = 0; k < weak; ++k) {
        std::array<double, kStates> vector{};
        for (Eigen::Index i = 0; i < kStates; ++i) {
            vector[static_cast<std::size_t>(i)] = basis(i, k);
        }
        result.null_vectors.push_back(vector);
    }
    return result;
}

int rank_with_shares(const std::vector<double>& azimuths_deg, const std::vector<Way>& ways,
                     const Site& site) {
    std::array<int, 3> first{-1, -1, -1};
    int all = kStates;
    for (const Way& way : ways) {
        int& at = first[static_cast<std::size_t>(way.upright)];
        if (at >= 0) continue;
        at = all;
        all += 3;
    }
    Eigen::VectorXd scale = Eigen::VectorXd::Constant(all, 1e-3);
    scale.head<kStates>() = scales(site);
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(6, all);
    h.leftCols<kStates>() = measurement_matrix(site);
    h = (h * scale.asDiagonal()).eval();
    Eigen::MatrixXd som(6 * all * static_cast<Eigen::Index>(ways.size() * azimuths_deg.size()),
                        all);
    Eigen::Index row = 0;
    for (const Way& way : ways) {
        for (const double azimuth : azimuths_deg) {
            const double psi = azimuth * kRadPerDeg;
            const double up = way.down ? -1 : 1;
            Eigen::Matrix3d level;  // columns: two level axes, the upright one
            level << std::cos(psi), -up * std::sin(psi), 0, std::sin(psi), up * std::cos(psi), 0, 0,
                0, up;
            Eigen::Matrix3d c;
            for (int i = 0; i < 3; ++i) c.col((way.upright + 1 + i) % 3) = level.col(i);
            Eigen::MatrixXd a = Eigen::MatrixXd::Zero(all, all);
            a.topLeftCorner<kStates, kStates>() =
                error_dynamics(c, {0, 0, site.gravity_mps2}, site);
            a.block<3, 3>(kVelocity, first[static_cast<std::size_t>(way.upright)]) =
                up * site.gravity_mps2 * c;
            a = (kTimeScale_s * (scale.cwiseInverse().asDiagonal() * a * scale.asDiagonal()))
                    .eval();
            Eigen::MatrixXd power = h;
            for (int i = 0; i < all; ++i) {
                som.middleRows<6>(row) = power;
                row += 6;
                power = (power * a).eval();
            }
        }
    }
    const auto [s, v] = linear_algebra::right_singular(som);
    int rank = 0;
    for (Eigen::Index i = 0; i < all; ++i) rank += s[i] > kRankLimit * s[0] ? 1 : 0;
    return rank;
}

void check_observable(const SlewPlan& plan, const Site& site) {
    plan.check();
    const Observability found = observability(plan.segments_deg(), site);
    if (found.sufficient()) {
        return;
    }
    const std::string why =
        found.rank < kStates
            ? text(
                  "slew plan: rank %d of 15, x and y zeros cannot be told from tilt; not "
                  "observable: ",
                  found.rank)
            : text(
                  "slew plan: smallest singular value %.2g of the scaled system, expected at "
                  "least %.0e; hardly observable: ",
                  found.singular[kStates - 1], kWeakest);
    throw ZeroError(why + found.unobservable());
}

}  // namespace vibrig::estimator::zeros
