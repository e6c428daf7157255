#include "estimator/plan/evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/plan/algebra.hpp"

namespace vibrig::estimator::plan {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Smallest singular value that counts, columns scaled to unit size, relative to the largest.
constexpr double kRankTolerance = 1e-9;
/// Share of a coefficient in a null vector from which on it is not determined.
constexpr double kShare = 1e-6;
/// What a run adds to the span of the others, from which on it is a remedy worth the name.
constexpr double kGoodRemedy = 0.05;

/// Singular values and right singular vectors of the weighted, scaled rows.
struct Decomposition {
    Vector scale, values;
    Matrix v;
    std::size_t rank = 0;
};

Decomposition decompose(const Problem& problem, const Effort& effort) {
    Decomposition d;
    const Matrix all = scaled_rows(problem, d.scale);
    const auto p = all.cols();
    Matrix used = Matrix::Zero(std::max<Eigen::Index>(all.rows(), p), p);
    for (Eigen::Index i = 0; i < all.rows(); ++i) {
        used.row(i) = std::sqrt(effort[static_cast<std::size_t>(i)]) * all.row(i);
    }
    auto svd = linear_algebra::right_singular(used);
    d.values = std::move(svd.values);
    d.v = std::move(svd.v);
    const double least = kRankTolerance * d.values[0];
    d.rank = static_cast<std::size_t>((d.values.array() > least).count());
    return d;
}

/// Reduced row echelon form, so that combinations that have nothing to do with one another stand
/// apart.
Matrix reduced(Matrix basis) {
    Eigen::Index row = 0;
    for (Eigen::Index col = 0; col < basis.cols() && row < basis.rows(); ++col) {
        Eigen::Index pivot = row;
        basis.col(col).tail(basis.rows() - row).cwiseAbs().maxCoeff(&pivot);
        pivot += row;
        if (std::abs(basis(pivot, col)) < kShare) continue;
        basis.row(row).swap(basis.row(pivot));
        basis.row(row) /= basis(row, col);
        for (Eigen::Index other = 0; other < basis.rows(); ++other) {
            if (other != row) basis.row(other) -= basis(other, col) * basis.row(row).eval();
        }
        ++row;
    }
    return basis;
}

void find_null_vectors(const Decomposition& d, const std::vector<std::size_t>& terms,
                       Evaluation& result) {
    const auto p = d.v.cols();
    const auto missing = p - at(d.rank);
    if (missing == 0) return;
    const Matrix basis = reduced(d.v.rightCols(missing).transpose());
    for (Eigen::Index k = 0; k < missing; ++k) {
        Vector physical = basis.row(k).transpose().cwiseQuotient(d.scale);
        physical /= physical.cwiseAbs().maxCoeff();
        Row row{};
        for (std::size_t i = 0; i < terms.size(); ++i) {
            row[terms[i]] = std::abs(basis(k, at(i))) > kShare ? physical[at(i)] : 0.0;
        }
        result.null_vectors.push_back(row);
    }
}

/// Covariance for the whole effort; of the determined part if the plan is rank deficient.
Matrix covariance(const Decomposition& d) {
    Matrix half = d.v.leftCols(at(d.rank));
    for (std::size_t k = 0; k < d.rank; ++k) half.col(at(k)) /= d.values[at(k)];
    half = d.scale.cwiseInverse().asDiagonal() * half;
    return linear_algebra::product(half, half.transpose());
}

double condition_of(const Decomposition& d) {
    Matrix information = linear_algebra::gram(d.values.asDiagonal() * d.v.transpose());
    const Vector size = information.diagonal().cwiseSqrt();
    if (!(size.minCoeff() > 0)) return kInfinity;
    information = size.cwiseInverse().asDiagonal() * information * size.cwiseInverse().asDiagonal();
    const Vector values = linear_algebra::symmetric_eigenvalues(information);
    const double least = values.minCoeff();
    return least > 0 ? values.maxCoeff() / least : kInfinity;
}

void find_strongest_correlation(const Matrix& cov, const std::vector<std::size_t>& terms,
                                Evaluation& result) {
    for (std::size_t i = 0; i < terms.size(); ++i) {
        for (std::size_t j = i + 1; j < terms.size(); ++j) {
            const double size = std::sqrt(cov(at(i), at(i)) * cov(at(j), at(j)));
            const double r = size > 0 ? cov(at(i), at(j)) / size : 0;
            if (std::abs(r) > std::abs(result.correlation)) {
                result.correlation = r;
                result.first = terms[i];
                result.second = terms[j];
            }
        }
    }
}

}  // namespace

std::vector<std::size_t> active(const Terms& terms) {
    std::vector<std::size_t> list;
    for (std::size_t i = 0; i < kTerms; ++i) {
        if (terms[i]) list.push_back(i);
    }
    return list;
}

Matrix rows(const std::vector<Point>& points, const Terms& terms) {
    const auto list = active(terms);
    Matrix result(at(points.size()), at(list.size()));
    for (std::size_t i = 0; i < points.size(); ++i) {
        for (std::size_t k = 0; k < list.size(); ++k) {
            result(at(i), at(k)) = points[i].f[list[k]] / points[i].noise;
        }
    }
    return result;
}

Matrix scaled_rows(const Problem& problem, Vector& scale) {
    Matrix result = rows(problem.points, problem.terms);
    scale = (result.colwise().squaredNorm() /
             static_cast<double>(std::max<Eigen::Index>(1, result.rows())))
                .cwiseSqrt()
                .transpose();
    // A term that is never excited but for rounding stays at zero. It is held against the terms of
    // its own degree: how large those of another are is a matter of the unit.
    const auto terms = active(problem.terms);
    const Vector found = scale;
    for (std::size_t i = 0; i < terms.size(); ++i) {
        double largest = 0;
        for (std::size_t k = 0; k < terms.size(); ++k)
            if (order_of(terms[k]) == order_of(terms[i])) largest = std::max(largest, found[at(k)]);
        if (!(found[at(i)] > kRankTolerance * largest))
            scale[at(i)] = largest > 0 ? largest : found.maxCoeff();
    }
    result = result * scale.cwiseInverse().asDiagonal();
    return result;
}

std::string Evaluation::undetermined() const {
    std::string names;
    for (std::size_t i = 0; i < kTerms; ++i) {
        const bool touched = std::any_of(null_vectors.begin(), null_vectors.end(),
                                         [i](const Row& v) { return v[i] != 0; });
        if (touched) names += (names.empty() ? "" : ", ") + std::string(kTermNames[i]);
    }
    return names;
}

Evaluation evaluate(const Problem& problem, const Effort& effort) {
    const auto terms = active(problem.terms);
    Evaluation result;
    result.coefficients = terms.size();
    for (std::size_t i = 0; i < problem.size(); ++i) {
        result.effort += effort[i] * problem.points[i].cost;
    }
    const Decomposition d = decompose(problem, effort);
    result.rank = d.rank;
    find_null_vectors(d, terms, result);
    const Matrix cov = covariance(d);
    for (std::size_t i = 0; i < terms.size(); ++i) {
        const bool lost = std::any_of(result.null_vectors.begin(), result.null_vectors.end(),
                                      [&](const Row& v) { return v[terms[i]] != 0; });
        result.sigma[terms[i]] = lost ? kInfinity : std::sqrt(cov(at(i), at(i)));
    }
    if (!result.identifies_all()) {
        result.log_det = -kInfinity;
        result.condition = result.trace = result.largest = kInfinity;
        return result;
    }
    result.condition = condition_of(d);
    result.log_det = 2 * (d.values.array().log().sum() + d.scale.array().log().sum()) -
                     static_cast<double>(terms.size()) * std::log(result.effort);
    result.trace = cov.trace() * result.effort;
    result.largest = linear_algebra::symmetric_eigenvalues(cov).maxCoeff() * result.effort;
    find_strongest_correlation(cov, terms, result);
    return result;
}

double equivalence_bound(const Problem& problem, const Effort& effort) {
    const Decomposition d = decompose(problem, effort);
    if (at(d.rank) < d.v.cols()) return 0;
    const Matrix cov = covariance(d);
    const Matrix all = rows(problem.points, problem.terms);
    double total = 0;
    double largest = 0;
    for (std::size_t i = 0; i < problem.size(); ++i) {
        const double cost = problem.points[i].cost;
        total += effort[i] * cost;
        largest = std::max(largest, all.row(at(i)).dot(cov * all.row(at(i)).transpose()) / cost);
    }
    return static_cast<double>(all.cols()) / (largest * total);
}

double d_efficiency(const Evaluation& plan, double optimal_log_det) noexcept {
    if (!plan.identifies_all()) return 0;
    return std::exp((plan.log_det - optimal_log_det) / static_cast<double>(plan.coefficients));
}

Remedy cheapest_remedy(const Problem& problem, const Effort& effort,
                       const std::vector<Point>& extra) {
    Remedy remedy;
    Problem both = problem;
    both.points.insert(both.points.end(), extra.begin(), extra.end());
    Effort all = effort;
    all.resize(both.size(), 0.0);
    for (;;) {
        const Decomposition d = decompose(both, all);
        const auto missing = d.v.cols() - at(d.rank);
        if (missing == 0) {
            remedy.complete = true;
            return remedy;
        }
        const Matrix null = d.v.rightCols(missing);
        Vector scale;
        const Matrix candidates = scaled_rows(both, scale);
        const auto gain = [&](std::size_t i) {
            const auto row = candidates.row(at(problem.size() + i));
            return (row * null).norm() / row.norm();
        };
        double strongest = 0;
        for (std::size_t i = 0; i < extra.size(); ++i) strongest = std::max(strongest, gain(i));
        if (strongest < kShare) return remedy;
        const double enough = std::min(kGoodRemedy, 0.5 * strongest);
        std::size_t best = extra.size();
        for (std::size_t i = 0; i < extra.size(); ++i) {
            if (gain(i) < enough) continue;
            if (best == extra.size() || extra[i].cost < extra[best].cost ||
                (extra[i].cost == extra[best].cost && gain(i) > gain(best) * (1 + 1e-9))) {
                best = i;
            }
        }
        remedy.points.push_back(best);
        all[problem.size() + best] += 1;
    }
}

}  // namespace vibrig::estimator::plan
