#include "estimator/allan/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr int kReweightings = 12;
constexpr double kRounding = 1e-9;  // relative, of a point of the curve
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, static_cast<int>(kTerms)>;
using Vector = Eigen::VectorXd;
using Squares = Eigen::Matrix<double, static_cast<int>(kTerms), 1>;  // squared coefficients

using Columns = std::vector<int>;

/// Columns differ by many decades in scale: X of min |part diag(1 / scale) X - b|, or nothing when
/// a column is zero.
struct Scaled {
    Eigen::MatrixXd part;
    Vector scale;
};
std::optional<Scaled> scaled(const Matrix& a, const Columns& columns) {
    Eigen::MatrixXd part = a(Eigen::all, columns);
    const Vector scale = part.colwise().norm();
    if (!(scale.minCoeff() > 0)) {
        return {};
    }
    return Scaled{part * scale.cwiseInverse().asDiagonal(), scale};
}

/// With five unknowns every set of non-zero terms can be tried: the best feasible one is the
/// non-negative least-squares solution, without an iteration that could stall.
Squares non_negative(const Matrix& a, const Vector& b, const std::array<bool, kTerms>& wanted) {
    Squares best = Squares::Zero();
    double least = b.squaredNorm();
    for (unsigned set = 1; set < (1U << kTerms); ++set) {
        Columns columns;
        bool all_wanted = true;
        for (unsigned j = 0; j < kTerms; ++j) {
            if ((set >> j & 1U) != 0) {
                columns.push_back(static_cast<int>(j));
                all_wanted = all_wanted && wanted[j];
            }
        }
        if (!all_wanted || static_cast<Eigen::Index>(columns.size()) > a.rows()) {
            continue;
        }
        const std::optional<Scaled> part = scaled(a, columns);
        if (!part) {
            continue;
        }
        const Vector x = linear_algebra::least_squares(part->part, b);
        const double rest = (part->part * x - b).squaredNorm();
        if (!x.allFinite() || x.minCoeff() <= 0 || rest >= least) {
            continue;
        }
        least = rest;
        best.setZero();
        for (std::size_t k = 0; k < columns.size(); ++k) {
            const auto at = static_cast<Eigen::Index>(k);
            best[columns[k]] = x[at] / part->scale[at];
        }
    }
    return best;
}

/// Standard error of the squared coefficient `j` in a fit of the terms that are not zero and it;
/// infinite when the curve cannot tell.
double error_of(int j, const Squares& squares, const Matrix& a, const Eigen::MatrixXd& covariance) {
    Columns columns{j};
    for (int other = 0; other < static_cast<int>(kTerms); ++other) {
        if (other != j && squares[other] > 0) {
            columns.push_back(other);
        }
    }
    const std::optional<Scaled> part = scaled(a, columns);
    if (!part || part->part.cols() > part->part.rows()) {
        return kInfinity;
    }
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(a.rows(), a.rows());
    const Vector gain =
        linear_algebra::least_squares(part->part, unit).row(0).transpose() / part->scale[0];
    return std::sqrt(std::max(0.0, gain.dot(covariance * gain)));
}

/// Of the weighted curve.
Eigen::MatrixXd weighted_covariance(std::span<const VariancePoint> curve, const Vector& weight,
                                    const CurveCovariance& covariance, const Terms& terms) {
    std::vector<std::size_t> factors;
    for (const VariancePoint& point : curve) {
        factors.push_back(point.m);
    }
    Eigen::MatrixXd c = covariance.of(factors, terms);
    for (Eigen::Index i = 0; i < c.rows(); ++i) {
        const VariancePoint& point = curve[static_cast<std::size_t>(i)];
        const double scale = weight[i] / std::sqrt(point.share);
        c.row(i) *= scale;
        c.col(i) *= scale;
    }
    // A ramp alone has no error, but the sums were rounded.
    for (Eigen::Index i = 0; i < c.rows(); ++i) {
        const VariancePoint& point = curve[static_cast<std::size_t>(i)];
        c(i, i) += std::pow(kRounding * weight[i] * point.variance, 2);
    }
    return c;
}

double edf_at(const VariancePoint& point, const Terms& terms, std::size_t points) {
    return std::max(1.0, point.share * edf(Statistic::oadev, dominant_noise(terms, point.tau),
                                           points, point.m));
}

void note_ramp(Fit& fit, double record_h) {
    const FittedTerm& k = fit.terms[static_cast<std::size_t>(Term::K)];
    FittedTerm& r = fit.terms[static_cast<std::size_t>(Term::R)];
    const double walk = k.value;
    // A ramp is known no better than the walk over the record lets it: K / sqrt(T).
    const double bound = walk / std::sqrt(record_h);
    if (!k.detected) {
        return;
    }
    r.sigma = r.value > 0 ? std::max(r.sigma, bound) : r.sigma;
    r.below = std::max(r.below, bound);
    if (!r.detected || r.value < 2 * bound) {
        std::ostringstream note;
        note.precision(3);
        note << "R is known no better than K/sqrt(T) = " << bound << " deg/h^2 in this record of "
             << record_h << " h";
        if (r.value > 0) {
            note << "; a record of " << 4 * walk * walk / (r.value * r.value)
                 << " h would show it at two standard errors";
        }
        fit.ramp_note = note.str();
    }
}

}  // namespace

Terms Fit::values() const {
    Terms values{};
    for (std::size_t j = 0; j < kTerms; ++j) {
        values[j] = terms[j].value;
    }
    return values;
}

Fit fit_noise(std::span<const VariancePoint> curve, const CurveCovariance& covariance,
              const std::array<bool, kTerms>& wanted) {
    const auto rows = static_cast<Eigen::Index>(curve.size());
    if (rows < 2) {
        throw DataError("fit: a curve of " + std::to_string(rows) +
                        " points found, at least 2 needed");
    }
    Vector model(rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
        model[i] = curve[static_cast<std::size_t>(i)].variance;
    }
    Vector weight(rows);
    Matrix a(rows, static_cast<int>(kTerms));
    Vector b(rows);
    Terms terms{};
    Squares squares;
    for (int round = 0; round <= kReweightings; ++round) {
        for (Eigen::Index i = 0; i < rows; ++i) {
            const VariancePoint& point = curve[static_cast<std::size_t>(i)];
            weight[i] = model[i] > 0
                            ? std::sqrt(edf_at(point, terms, covariance.points()) / 2) / model[i]
                            : 0;
            b[i] = weight[i] * point.variance;
            for (std::size_t j = 0; j < kTerms; ++j) {
                a(i, static_cast<Eigen::Index>(j)) =
                    weight[i] * term_variance(static_cast<Term>(j), point.tau);
            }
        }
        squares = non_negative(a, b, wanted);
        for (std::size_t j = 0; j < kTerms; ++j) {
            terms[j] = std::sqrt(squares[static_cast<Eigen::Index>(j)]);
        }
        for (Eigen::Index i = 0; i < rows; ++i) {
            model[i] = model_variance(terms, curve[static_cast<std::size_t>(i)].tau);
        }
    }
    const Eigen::MatrixXd errors = weighted_covariance(curve, weight, covariance, terms);
    Fit fit;
    for (std::size_t j = 0; j < kTerms; ++j) {
        FittedTerm& term = fit.terms[j];
        const double square = squares[static_cast<Eigen::Index>(j)];
        const double error = error_of(static_cast<int>(j), squares, a, errors);
        term.value = terms[j];
        term.detected = square > kDetected * error;
        term.sigma = term.value > 0 ? error / (2 * term.value) : 0;  // d(c^2) = 2 c dc
        term.below = std::sqrt(square + kBound * error);
    }
    note_ramp(fit, static_cast<double>(covariance.points() - 1) * covariance.tau0() / 3600);
    return fit;
}

Fit fit_noise(std::span<const VariancePoint> curve, std::size_t points, double tau0,
              const std::array<bool, kTerms>& wanted) {
    std::vector<std::size_t> factors;
    for (const VariancePoint& point : curve) {
        factors.push_back(point.m);
    }
    return fit_noise(curve, CurveCovariance(factors, points, tau0), wanted);
}

}  // namespace vibrig::estimator::allan
