#include "estimator/zeros/together.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/zeros/units.hpp"

namespace vibrig::estimator::zeros {
namespace {

constexpr double kExact_mg = 1e-6;  // of a share that is declared to be none
/// A share whose sigma is this part of what is declared of it has been found.
constexpr double kDetermined = 0.1;
constexpr Eigen::Index kSize = Joint::kSize;

/// Unknown, all in mg: three zeros; what each accelerometer shows of 1 g along each axis while that
/// is level; three shares of each axis that was upright.
struct Unknowns {
    explicit Unknowns(const std::vector<CalibrationResult>& runs) {
        for (const CalibrationResult& run : runs) {
            const auto k = static_cast<std::size_t>(run.upright);
            (run.inverted ? down : up)[k] = true;
            if (share[k] >= 0) continue;
            share[k] = count;
            count += 3;
        }
    }
    [[nodiscard]] bool both_ways(std::size_t k) const { return up[k] && down[k]; }
    [[nodiscard]] static Eigen::Index level(std::size_t of, std::size_t axis) {
        return static_cast<Eigen::Index>(3 + 3 * of + axis);
    }

    std::array<Eigen::Index, 3> share{-1, -1, -1};
    std::array<bool, 3> up{}, down{};
    Eigen::Index count = 12;
};

/// What the states of a run's filter are of the unknowns.
Eigen::MatrixXd seen_of(const CalibrationResult& run, const Unknowns& at) {
    Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(kSize, at.count);
    for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t of = platform_axis(run.upright, i);
        const auto row = static_cast<Eigen::Index>(i), platform = static_cast<Eigen::Index>(of);
        seen(row, platform) = 1;
        seen(row, at.share[static_cast<std::size_t>(run.upright)] + platform) =
            run.inverted ? -1 : 1;
        for (std::size_t j = 0; j < 2; ++j)
            seen(3 + 2 * row + static_cast<Eigen::Index>(j),
                 Unknowns::level(of, platform_axis(run.upright, j))) = 1;
    }
    return seen;
}

Eigen::MatrixXd matrix_of(const Joint& joint) {
    Eigen::MatrixXd covariance(kSize, kSize);
    for (Eigen::Index i = 0; i < kSize; ++i) {
        for (Eigen::Index j = 0; j < kSize; ++j)
            covariance(i, j) =
                joint.covariance[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
    return covariance;
}

/// What is declared of a share; mg.
double declared_of(const CalibrationResult& run, std::size_t i) {
    return std::sqrt(std::max(0.0, run.covariance_mg2[i][i] - run.filter_covariance_mg2[i][i]));
}

struct Solution {
    Eigen::VectorXd value;
    Eigen::MatrixXd covariance;
};

/// Misalignments in what is shown of the level axes are taken for `size_mg` at least.
Solution solve(const std::vector<CalibrationResult>& runs, const Unknowns& at, double size_mg) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(at.count, at.count);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(at.count);
    const auto know = [&](Eigen::Index unknown, double sigma_mg) {
        normal(unknown, unknown) += std::pow(std::max(sigma_mg, kExact_mg), -2);
    };
    std::array<std::array<bool, 3>, 3> known{};
    std::array<bool, 3> declared{};
    for (const CalibrationResult& run : runs) {
        const auto k = static_cast<std::size_t>(run.upright);
        const Eigen::MatrixXd seen = seen_of(run, at);
        Eigen::MatrixXd information = linear_algebra::PivotedCholesky(matrix_of(run.joint))
                                          .solve(Eigen::MatrixXd::Identity(kSize, kSize));
        const Eigen::Map<const Eigen::VectorXd> value(run.joint.value.data(), kSize);
        right += seen.transpose() * (information * value);
        // The filter's prior of what is shown of the level axes is the same in
        // all runs and counts once.
        for (std::size_t state = 3; state < Joint::kSize; ++state) {
            const double prior = run.joint.prior[state];
            const auto row = static_cast<Eigen::Index>(state);
            information(row, row) -= std::pow(prior, -2);
            const std::size_t of = platform_axis(run.upright, (state - 3) / 2);
            const std::size_t axis = platform_axis(run.upright, (state - 3) % 2);
            if (!std::exchange(known[of][axis], true))
                know(Unknowns::level(of, axis), of == axis ? prior : std::max(prior, size_mg));
        }
        normal += seen.transpose() * information * seen;
        if (at.both_ways(k) || std::exchange(declared[k], true)) continue;
        for (std::size_t i = 0; i < 3; ++i)
            know(at.share[k] + static_cast<Eigen::Index>(i), declared_of(run, i));
    }
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j)
            if (!known[i][j]) know(Unknowns::level(i, j), kExact_mg);
    }
    const Eigen::MatrixXd covariance = linear_algebra::PivotedCholesky(normal).solve(
        Eigen::MatrixXd::Identity(at.count, at.count));
    return {covariance * right, covariance};
}

/// Root mean square of the misalignments that the runs determine; 0: of none.
double size_found(const std::vector<CalibrationResult>& runs, const Unknowns& at,
                  const Solution& found) {
    double squares = 0, n = 0;
    std::array<bool, 3> done{};
    for (const CalibrationResult& run : runs) {
        const auto k = static_cast<std::size_t>(run.upright);
        if (std::exchange(done[k], true)) continue;
        for (std::size_t i = 0; i < 3; ++i) {
            const Eigen::Index share = at.share[k] + static_cast<Eigen::Index>(i);
            const double sigma = std::sqrt(found.covariance(share, share));
            if (i == k || !(sigma < kDetermined * declared_of(run, i))) continue;
            squares += found.value[share] * found.value[share];
            ++n;
        }
    }
    return n > 0 ? std::sqrt(squares / n) : 0;
}

}  // namespace

ZerosApart together(const std::vector<CalibrationResult>& runs) {
    const Unknowns at(runs);
    Solution found = solve(runs, at, 0);
    // Misalignments larger than declared say how large those are that cannot be found.
    if (const double size = size_found(runs, at, found); size > 0) found = solve(runs, at, size);
    ZerosApart r;
    for (std::size_t i = 0; i < 3; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        r.zero_mg[i] = found.value[row];
        for (std::size_t j = 0; j < 3; ++j)
            r.covariance_mg2[i][j] = found.covariance(row, static_cast<Eigen::Index>(j));
        for (std::size_t k = 0; k < 3; ++k) {
            if (at.share[k] < 0) continue;
            const Eigen::Index share = at.share[k] + row;
            r.share[i][k] = 1e-3 * found.value[share];
            r.share_sigma[i][k] = 1e-3 * std::sqrt(found.covariance(share, share));
        }
    }
    return r;
}

}  // namespace vibrig::estimator::zeros
