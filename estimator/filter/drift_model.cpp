#include "estimator/filter/drift_model.hpp"

#include <Eigen/Geometry>
#include <type_traits>
#include <utility>

#include "estimator/filter/product.hpp"

namespace vibrig::estimator {
namespace {

/// `each` is called with each group as a constant: the filter's inner loop, written out.
template <typename Each>
void for_each_group(Each each) {
    [&]<std::size_t... G>(std::index_sequence<G...>) {
        (each(std::integral_constant<std::size_t, G>{}), ...);
    }
    (std::make_index_sequence<kGroups>{});
}

}  // namespace

DriftModel::DriftModel(const Settings& settings) : axes_{}, sign_(settings.drift_sign) {
    for (std::size_t j = 0; j < kGyros; ++j) {
        for (std::size_t k = 0; k < 3; ++k) {
            axes_[j].axis[k] = settings.gyro_axes[j][k].axis;
            axes_[j].sign[k] = settings.gyro_axes[j][k].sign;
        }
    }
}

Regressors DriftModel::regressors(const Eigen::Vector3d& up,
                                  const Eigen::Matrix3d& moment) const noexcept {
    Regressors h{};
    for (std::size_t j = 0; j < kGyros; ++j) {
        const GyroAxes& g = axes_[j];
        for_each_group([&](auto group) {
            constexpr CoefficientRow kRow = kCoefficientTable[group];
            constexpr auto p = kRow.p, q = kRow.q;
            if constexpr (kRow.order == 0) {
                h[group][j] = 1.0;
            } else if constexpr (kRow.order == 1) {
                h[group][j] = g.sign[p] * up[g.axis[p]];
            } else {
                h[group][j] = g.sign[p] * g.sign[q] * moment(g.axis[p], g.axis[q]);
            }
        });
    }
    return h;
}

Eigen::Vector3d DriftModel::platform_rate(const Pose& pose, const Regressors& h,
                                          const double* parameters) const noexcept {
    Eigen::Vector3d drift = Eigen::Vector3d::Zero();
    for (std::size_t group = 0; group < kGroups; ++group) {
        for (std::size_t j = 0; j < kGyros; ++j) {
            drift[static_cast<Eigen::Index>(j)] +=
                h[group][j] * parameters[internal_index(group, j)];
        }
    }
    return sign_ * drift - pose.earth_rate;
}

Eigen::Matrix3d DriftModel::jacobian(const Pose& pose, const Eigen::Matrix3d& moment,
                                     const double* parameters,
                                     const Eigen::Vector3d& platform_rate) const noexcept {
    // A turn of the platform by e changes u by e x u and S by E S - S E, E = [e x]; what that does
    // to a gyro's drift, l . u + tr(Q S), is e . (u x l + 2 axial(S Q)).
    Eigen::Matrix3d turning;  // one gyro a row
    for (std::size_t j = 0; j < kGyros; ++j) {
        const GyroAxes& g = axes_[j];
        Eigen::Vector3d linear;
        Eigen::Matrix3d quadratic;
        for_each_group([&](auto group) {
            constexpr CoefficientRow kRow = kCoefficientTable[group];
            constexpr auto p = kRow.p, q = kRow.q;
            const double d = parameters[internal_index(group, j)];
            if constexpr (kRow.order == 1) {
                linear[g.axis[p]] = g.sign[p] * d;
            } else if constexpr (kRow.order == 2 && p == q) {
                quadratic(g.axis[p], g.axis[p]) = d;
            } else if constexpr (kRow.order == 2) {
                // A product of two axes stands twice in the symmetric matrix, half each time.
                quadratic(g.axis[p], g.axis[q]) = quadratic(g.axis[q], g.axis[p]) =
                    0.5 * g.sign[p] * g.sign[q] * d;
            }
        });
        const Eigen::Matrix3d a = product(moment, quadratic);
        turning.row(static_cast<Eigen::Index>(j)) =
            pose.up.cross(linear) +
            2.0 * Eigen::Vector3d(a(1, 2) - a(2, 1), a(2, 0) - a(0, 2), a(0, 1) - a(1, 0));
    }
    Eigen::Matrix3d j;
    for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d& e = pose.axis[static_cast<std::size_t>(k)];
        const Eigen::Vector3d dw = sign_ * (turning * e) - e.cross(pose.earth_rate);
        j.col(k) = pose.m * dw;
    }
    // d m / d angle, applied to the rate.
    const double cb = pose.cos_beta, sb = pose.sin_beta, cg = pose.cos_gamma, sg = pose.sin_gamma;
    const double p = cg * platform_rate[0] + sg * platform_rate[1];
    const double r = sg * platform_rate[0] - cg * platform_rate[1];
    j.col(1) += Eigen::Vector3d(-p * sb / (cb * cb), 0.0, -p / (cb * cb));
    j.col(2) += Eigen::Vector3d(r / cb, p, r * sb / cb);
    return j;
}

}  // namespace vibrig::estimator
