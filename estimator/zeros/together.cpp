#include "estimator/zeros/together.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/zeros/units.hpp"

namespace vibrig::estimator::zeros {
namespace {

constexpr double kExact_mg = 1e-6;  // of a share that is declared to be none

}  // namespace

ZerosApart together(const std::vector<CalibrationResult>& runs) {
    // Unknown: three zeros, then three shares of each axis that was upright, all in mg.
    std::array<Eigen::Index, 3> first{-1, -1, -1};
    std::array<bool, 3> up{}, down{};
    Eigen::Index unknowns = 3;
    for (const CalibrationResult& run : runs) {
        const auto k = static_cast<std::size_t>(run.upright);
        (run.inverted ? down : up)[k] = true;
        if (first[k] >= 0) continue;
        first[k] = unknowns;
        unknowns += 3;
    }
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
    for (const CalibrationResult& run : runs) {
        const auto k = static_cast<std::size_t>(run.upright);
        const Eigen::Matrix3d information = matrix(run.filter_covariance_mg2).inverse();
        const double sign = run.inverted ? -1 : 1;
        Eigen::Vector3d seen;
        for (Eigen::Index i = 0; i < 3; ++i)
            seen[i] = run.axis[static_cast<std::size_t>(i)].zero_mg;
        normal.topLeftCorner<3, 3>() += information;
        normal.block<3, 3>(first[k], first[k]) += information;
        normal.block<3, 3>(0, first[k]) += sign * information;
        normal.block<3, 3>(first[k], 0) += sign * information;
        right.head<3>() += information * seen;
        right.segment<3>(first[k]) += sign * information * seen;
        if (up[k] && down[k]) continue;
        for (std::size_t i = 0; i < 3; ++i) {
            const double declared = std::sqrt(
                std::max(0.0, run.covariance_mg2[i][i] - run.filter_covariance_mg2[i][i]));
            const Eigen::Index at = first[k] + static_cast<Eigen::Index>(i);
            normal(at, at) += std::pow(std::max(declared, kExact_mg), -2);
        }
    }
    const Eigen::MatrixXd covariance =
        normal.ldlt().solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    const Eigen::VectorXd found = covariance * right;
    ZerosApart r;
    for (std::size_t i = 0; i < 3; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        r.zero_mg[i] = found[row];
        for (std::size_t j = 0; j < 3; ++j)
            r.covariance_mg2[i][j] = covariance(row, static_cast<Eigen::Index>(j));
        for (std::size_t k = 0; k < 3; ++k) {
            if (first[k] < 0) continue;
            r.share[i][k] = 1e-3 * found[first[k] + row];
            r.share_sigma[i][k] = 1e-3 * std::sqrt(covariance(first[k] + row, first[k] + row));
        }
    }
    return r;
}

}  // namespace vibrig::estimator::zeros
