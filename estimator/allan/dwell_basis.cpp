#include "estimator/allan/dwell_basis.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::allan {

namespace {

using Eigen::Index;
using linear_algebra::product;

/// Entry (i, k) from the numbers of two blocks.
template <typename F>
Eigen::MatrixXd matrix_of(const std::vector<std::size_t>& blocks, F&& entry) {
    const auto n = static_cast<Index>(blocks.size());
    Eigen::MatrixXd matrix(n, n);
    for (Index i = 0; i < n; ++i) {
        for (Index k = 0; k < n; ++k) {
            matrix(i, k) = entry(static_cast<double>(blocks[static_cast<std::size_t>(i)]),
                                 static_cast<double>(blocks[static_cast<std::size_t>(k)]));
        }
    }
    return matrix;
}

/// Mean over block a times mean over block b of a random walk from zero: the smaller time, and in
/// the same block a third of the block instead of a half.
double walk_covariance(double a, double b) { return a == b ? a + 1.0 / 3.0 : std::min(a, b) + 0.5; }

/// B' C B.
Eigen::MatrixXd sandwich(const Eigen::MatrixXd& b, const Eigen::MatrixXd& c) {
    return product(b.transpose(), product(c, b));
}

}  // namespace

DwellBasis::DwellBasis(std::vector<std::size_t> present) : present_(std::move(present)) {
    const auto n = static_cast<Index>(present_.size());
    Eigen::MatrixXd line(n, 2);
    const double centre =
        0.5 * (static_cast<double>(present_.front()) + static_cast<double>(present_.back()));
    for (Index i = 0; i < n; ++i) {
        line(i, 0) = 1;
        line(i, 1) = static_cast<double>(present_[static_cast<std::size_t>(i)]) - centre;
    }
    const Eigen::MatrixXd free = linear_algebra::orthogonal_factor(line).rightCols(n - 2);
    const Eigen::MatrixXd walking = matrix_of(present_, walk_covariance);
    const auto eigen = linear_algebra::symmetric_eigen(sandwich(free, walking));
    basis_ = product(free, eigen.vectors);
    walk = eigen.values.cwiseMax(0.0);

    // Generalised covariances of the angle: they hold for contrasts that no line changes. Their
    // second differences have the Allan variances 2 ln2/pi B^2, (K/60)^2 tau/3, (R/3600)^2 tau^2/2.
    const auto in_contrasts = [&](const Eigen::MatrixXd& c) { return sandwich(basis_, c); };
    slow[0] = in_contrasts(matrix_of(present_, [](double a, double b) {
        const double t = std::abs(a - b);
        return t > 0 ? t * t * std::log(t) / (2 * std::numbers::pi) : 0.0;
    }));
    slow[1] = in_contrasts(matrix_of(
        present_, [](double a, double b) { return std::pow(std::abs(a - b), 3) / (12 * 3600.0); }));
    slow[2] = in_contrasts(matrix_of(present_, [&](double a, double b) {
        const double curve = (a - centre) * (a - centre) * (b - centre) * (b - centre);
        return curve / (4 * 3600.0 * 3600.0);
    }));
    for (std::size_t t = 0; t < slow.size(); ++t) slow_squares[t] = slow[t].cwiseProduct(slow[t]);
    add_octaves(walking);
}

Eigen::VectorXd DwellBasis::contrasts(const std::vector<double>& angle) const {
    const Eigen::Map<const Eigen::VectorXd> values(angle.data(), static_cast<Index>(angle.size()));
    // Without the first value the digits of a large angle are kept.
    return basis_.transpose() * (values.array() - angle.front()).matrix();
}

void DwellBasis::add_octaves(const Eigen::MatrixXd& walk_covariance) {
    const auto n = static_cast<Index>(present_.size());
    const std::size_t span = present_.back() - present_.front() + 1;
    for (std::size_t m = 1; 4 * m <= span; m *= 2) {
        const auto step = static_cast<Index>(m);
        Octave octave;
        octave.m = m;
        std::vector<Index> starts;
        for (Index i = 0; i + 3 * step <= n; ++i) {
            const auto first = static_cast<std::size_t>(i);
            // Nothing spans a gap.
            if (present_[first + 3 * m - 1] - present_[first] == 3 * m - 1) starts.push_back(i);
        }
        if (starts.empty()) break;
        octave.differences = Eigen::MatrixXd::Zero(static_cast<Index>(starts.size()), n);
        for (std::size_t row = 0; row < starts.size(); ++row) {
            for (Index j = 0; j < 3 * step; ++j) {
                octave.differences(static_cast<Index>(row), starts[row] + j) =
                    (j / step == 1 ? -2.0 : 1.0) / static_cast<double>(m);
            }
        }
        const Eigen::MatrixXd white = linear_algebra::gram(octave.differences.transpose());
        const Eigen::MatrixXd walking = sandwich(octave.differences.transpose(), walk_covariance);
        octave.white_trace = white.trace();
        octave.walk_trace = walking.trace();
        octave.white_square = white.squaredNorm();
        octave.product = white.cwiseProduct(walking).sum();
        octave.walk_square = walking.squaredNorm();
        octaves.push_back(std::move(octave));
    }
}

}  // namespace vibrig::estimator::allan
