#include "estimator/uncertainty/population.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/distributions.hpp"

namespace vibrig::estimator::uncertainty {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Without what cannot be of a covariance.
MatrixXd positive_part(const MatrixXd& of) {
    const auto [values, vectors] = linear_algebra::symmetric_eigen(of);
    return linear_algebra::product(vectors * values.cwiseMax(0).asDiagonal(), vectors.transpose());
}

/// Sums over units; rows of `mean`: a unit each.
struct Sums {
    MatrixXd mean;
    MatrixXd scatter;      ///< of campaigns about their unit's mean
    MatrixXd scatter_due;  ///< to what was measured
    MatrixXd mean_due;     ///< covariance of a unit's mean, due to what was measured
    double share = 0;      ///< mean over units of 1 / campaigns
    std::size_t campaigns = 0;
};

void check_one(const Found& one, Index size, std::size_t unit) {
    if (one.value.size() != size || one.covariance.rows() != size ||
        one.covariance.cols() != size || !one.value.allFinite() || !one.covariance.allFinite())
        throw std::invalid_argument("unit " + std::to_string(unit + 1) + ": found " +
                                    std::to_string(one.value.size()) + " values, expected " +
                                    std::to_string(size) + " finite ones with their covariance");
}

Sums sum_up(const std::vector<std::vector<Found>>& units) {
    if (units.size() < kFewestUnits || units.front().empty())
        throw std::invalid_argument("found " + std::to_string(units.size()) +
                                    " units, expected at least " + std::to_string(kFewestUnits));
    const Index size = units.front().front().value.size();
    const auto n = static_cast<double>(units.size());
    const MatrixXd zero = MatrixXd::Zero(size, size);
    Sums sums{MatrixXd(static_cast<Index>(units.size()), size), zero, zero, zero};
    for (std::size_t i = 0; i < units.size(); ++i) {
        const auto k = static_cast<double>(units[i].size());
        if (units[i].empty()) throw std::invalid_argument("found a unit without campaigns");
        VectorXd mean = VectorXd::Zero(size);
        MatrixXd measured = zero;
        for (const Found& one : units[i]) {
            check_one(one, size, i);
            mean += one.value / k;
            measured += one.covariance / k;
        }
        for (const Found& one : units[i])
            sums.scatter += (one.value - mean) * (one.value - mean).transpose();
        sums.scatter_due += (k - 1) * measured;
        sums.mean_due += measured / (k * n);
        sums.share += 1 / (k * n);
        sums.campaigns += units[i].size();
        sums.mean.row(static_cast<Index>(i)) = mean.transpose();
    }
    return sums;
}

/// Which share of the correlations between units is to be given up: their variances over their
/// squares, of standardised values.
double shrinkage(const MatrixXd& centred) {
    const auto n = static_cast<double>(centred.rows());
    MatrixXd z = centred;
    for (Index j = 0; j < z.cols(); ++j) {
        const double sigma = std::sqrt(z.col(j).squaredNorm() / (n - 1));
        if (sigma > 0) z.col(j) /= sigma;
    }
    double variances = 0, squares = 0;
    for (Index i = 0; i < z.cols(); ++i) {
        for (Index j = 0; j < i; ++j) {
            const VectorXd w = z.col(i).cwiseProduct(z.col(j));
            const double mean = w.mean();
            variances += n / std::pow(n - 1, 3) * (w.array() - mean).square().sum();
            squares += std::pow(mean * n / (n - 1), 2);
        }
    }
    return squares > 0 ? std::clamp(variances / squares, 0.0, 1.0) : 1;
}

}  // namespace

Population population_of(const std::vector<std::vector<Found>>& units) {
    const Sums sums = sum_up(units);
    const auto n = static_cast<double>(units.size());
    const double nu = n - 1;
    const Index size = sums.mean.cols();
    Population out;
    out.units = units.size();
    out.campaigns = sums.campaigns;
    out.mean = sums.mean.colwise().mean().transpose();
    const MatrixXd centred = sums.mean.rowwise() - out.mean.transpose();
    const MatrixXd seen = centred.transpose() * centred / nu;
    out.within = MatrixXd::Zero(size, size);
    if (const double repeated = static_cast<double>(out.campaigns) - n; repeated > 0)
        out.within = positive_part((sums.scatter - sums.scatter_due) / repeated);
    out.between = positive_part(seen - sums.share * out.within - sums.mean_due);

    MatrixXd next = seen + (1 - sums.share) * out.within - sums.mean_due;
    VectorXd sigma(size);
    for (Index i = 0; i < size; ++i) {
        // What is left of a difference is known no better than what it was taken from.
        const double least = std::max(seen(i, i), sums.mean_due(i, i)) * std::sqrt(2 / nu);
        sigma(i) = std::sqrt(std::max({next(i, i), least, 1e-300}));
    }
    for (Index i = 0; i < size; ++i)
        for (Index j = 0; j < size; ++j)
            next(i, j) = i == j ? 1 : std::clamp(next(i, j) / (sigma(i) * sigma(j)), -1.0, 1.0);
    // So many units tell of so many directions, and of no more.
    const double most = std::max(1.0, nu / 3);
    const double least_share =
        size > 1 ? std::clamp(1 - (most - 1) / static_cast<double>(size - 1), 0.0, 1.0) : 1;
    out.independent = std::max(shrinkage(centred), least_share);
    const double lowest = linear_algebra::symmetric_eigenvalues(next)(0);
    // (1 - a) lowest + a stays above a hundredth.
    constexpr double kLowest = 0.01;
    if (lowest < kLowest)
        out.independent = std::max(out.independent, (kLowest - lowest) / (1 - lowest));
    for (Index i = 0; i < size; ++i)
        for (Index j = 0; j < size; ++j)
            if (i != j) next(i, j) *= 1 - out.independent;
    const double directions = 1 + static_cast<double>(size - 1) * (1 - out.independent);
    const double wider = (1 + 1 / n) * nu / (nu - 1 - std::min(directions, most));
    out.predicted = wider * (sigma * sigma.transpose()).cwiseProduct(next);
    return out;
}

Distance distance(const Population& type, const Found& unit) {
    const VectorXd off = unit.value - type.mean;
    const auto root = linear_algebra::Cholesky::of(type.predicted + unit.covariance);
    Distance out;
    out.squared =
        root ? off.dot(root->solve(off).col(0)) : std::numeric_limits<double>::quiet_NaN();
    const auto size = static_cast<double>(off.size());
    const double nu = static_cast<double>(type.units) - 1;
    // A square of Student's t over its mean scatters more than one of the normal distribution.
    out.dof = size * (nu - 4) / (nu - 1);
    out.p = chi_square_tail(out.squared * out.dof / size, out.dof);
    return out;
}

Found with_type(const Population& type, const Found& unit) {
    const MatrixXd gain = linear_algebra::product(
        unit.covariance, linear_algebra::positive_inverse(type.predicted + unit.covariance));
    Found out{unit.value - gain * (unit.value - type.mean),
              unit.covariance - gain * unit.covariance};
    out.covariance = (out.covariance + out.covariance.transpose().eval()) / 2;
    return out;
}

}  // namespace vibrig::estimator::uncertainty
