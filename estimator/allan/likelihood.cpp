#include "estimator/allan/likelihood.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::allan {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Nearer points hold the same differences and would only magnify the covariance's rounding.
constexpr double kSpacing = 1.8;
constexpr double kRounding = 1e-9;  // relative, of a point of the curve
constexpr double kCovarianceError = 0.02;
constexpr double kNegligible = 1e-5;  // of every point of the curve
constexpr int kMostSteps = 60;
constexpr double kSmallGain = 1e-3;  // of the deviance: thresholds are whole numbers
constexpr double kLongestStep = 1.5;
constexpr double kHeavy = 0.1;  // damping, that a small step comes from
constexpr double kNoGain = 1e-7;
constexpr double kMostDamping = 1e8;
constexpr std::size_t kNoneFixed = kTerms;

}  // namespace

CurveLikelihood::CurveLikelihood(std::span<const VariancePoint> curve,
                                 const CurveCovariance& covariance) {
    std::vector<std::size_t> factors;
    for (const VariancePoint& point : curve) {
        const bool near = !factors.empty() && static_cast<double>(point.m) <
                                                  kSpacing * static_cast<double>(factors.back());
        // The last point weighs most for what is slow.
        if (point.variance > 0 && (!near || &point == &curve.back())) {
            points_.push_back(point);
            factors.push_back(point.m);
        }
    }
    covariance_ = covariance.at(factors);
    const auto rows = static_cast<Index>(points_.size());
    basis_.resize(rows, static_cast<Index>(kTerms));
    share_.resize(rows);
    for (Index i = 0; i < rows; ++i) {
        const VariancePoint& point = points_[static_cast<std::size_t>(i)];
        share_[i] = 1 / std::sqrt(point.share);
        for (std::size_t j = 0; j < kTerms; ++j) {
            basis_(i, static_cast<Index>(j)) = term_variance(static_cast<Term>(j), point.tau);
        }
    }
}

CurveLikelihood::Evaluated CurveLikelihood::evaluate(const Terms& squares, bool for_step) const {
    Evaluated out;
    Terms terms{};
    std::transform(squares.begin(), squares.end(), terms.begin(),
                   [](double square) { return std::sqrt(square); });
    const Eigen::Map<const VectorXd> x(squares.data(), static_cast<Index>(kTerms));
    out.mean = basis_ * x;
    out.deviance = std::numeric_limits<double>::infinity();
    if (!(out.mean.minCoeff() > 0) || !out.mean.allFinite()) return out;
    // Of v over its mean: numbers near one, whatever the unit.
    const VectorXd scale = share_.cwiseQuotient(out.mean);
    MatrixXd c = scale.asDiagonal() * covariance_.of(terms) * scale.asDiagonal();
    c.diagonal().array() += kRounding * kRounding;
    std::optional<linear_algebra::Cholesky> factor;
    // The sums over lags are good to about 1 %, and points near one another almost the same.
    for (double error = kCovarianceError; !factor && error < 1; error *= 4) {
        c.diagonal() *= 1 + error;
        out.added *= 1 + error;
        factor = linear_algebra::Cholesky::of(c);
    }
    if (!factor) return out;
    VectorXd r(points_.size());
    for (Index i = 0; i < r.size(); ++i) {
        r[i] = std::cbrt(points_[static_cast<std::size_t>(i)].variance / out.mean[i]) - 1 +
               c(i, i) / 9;
    }
    out.spread = c.diagonal() / 9;
    if (for_step) {
        out.information = 9 * factor->inverse();
        out.difference = r;
        out.relative = std::move(c);
    }
    // ln det C = ln det c + 2 sum ln mu.
    out.deviance = 9 * r.dot(factor->solve(r).col(0)) + factor->log_det() +
                   (2 - 4.0 / 3) * out.mean.array().log().sum();
    return out;
}

double CurveLikelihood::largest_square(std::size_t term) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < points_.size(); ++i) {
        least = std::min(
            least, points_[i].variance / basis_(static_cast<Index>(i), static_cast<Index>(term)));
    }
    return least;
}

double CurveLikelihood::excess(const Terms& squares, std::size_t point) const {
    const Evaluated at = evaluate(squares, false);
    const auto i = static_cast<Index>(point);
    return (std::cbrt(points_[point].variance / at.mean[i]) - 1 + at.spread[i]) /
           std::sqrt(at.spread[i]);
}

bool CurveLikelihood::negligible(const TermFit& fit) const {
    const Eigen::Map<const VectorXd> x(fit.square.data(), static_cast<Index>(kTerms));
    const VectorXd mean = basis_ * x;
    for (std::size_t j = 0; j < kTerms; ++j) {
        const VectorXd part = fit.square[j] * basis_.col(static_cast<Index>(j));
        if (fit.has[j] && part.cwiseQuotient(mean).maxCoeff() < kNegligible) return true;
    }
    return false;
}

double CurveLikelihood::gradient_of(const Evaluated& here, const Terms& squares, std::size_t term,
                                    const VectorXd& part) const {
    Terms terms{};
    std::transform(squares.begin(), squares.end(), terms.begin(),
                   [](double square) { return std::sqrt(square); });
    const VectorXd scale = share_.cwiseQuotient(here.mean);
    MatrixXd c = scale.asDiagonal() * covariance_.slope(terms, term) * scale.asDiagonal();
    c.diagonal() *= here.added;
    for (Index column = 0; column < c.cols(); ++column) {
        c.col(column) -=
            (part.array() + part[column]).matrix().cwiseProduct(here.relative.col(column));
    }
    VectorXd r(part.size());
    for (Index i = 0; i < r.size(); ++i) {
        const double root = here.difference[i] + 1 - here.spread[i];
        r[i] = -root * part[i] / 3 + c(i, i) / 9;
    }
    const VectorXd w = here.information * here.difference;
    // information = 9 c^-1.
    return 2 * w.dot(r) - w.dot(c * w) / 9 + here.information.cwiseProduct(c).sum() / 9 +
           (2 - 4.0 / 3) * part.sum();
}

std::optional<TermFit> CurveLikelihood::minimise(const TermSet& set, Terms squares,
                                                 std::size_t fixed) const {
    std::vector<std::size_t> free;
    for (std::size_t j = 0; j < kTerms; ++j) {
        if (set[j] && j != fixed) free.push_back(j);
    }
    const auto count = static_cast<Index>(free.size());
    const auto moved = [&](const VectorXd& by) {
        Terms at = squares;
        for (Index k = 0; k < count; ++k) at[free[static_cast<std::size_t>(k)]] *= std::exp(by[k]);
        return at;
    };
    MatrixXd information = MatrixXd::Identity(count, count);
    Evaluated here = evaluate(squares, true);
    double damping = std::isfinite(here.deviance) ? 1e-3 : kMostDamping;
    for (int step = 0; step < kMostSteps && count > 0 && damping < kMostDamping; ++step) {
        VectorXd gradient(count);
        MatrixXd slope(basis_.rows(), count);
        for (Index k = 0; k < count; ++k) {
            const std::size_t j = free[static_cast<std::size_t>(k)];
            const VectorXd part =
                squares[j] * basis_.col(static_cast<Index>(j)).cwiseQuotient(here.mean);
            gradient[k] = gradient_of(here, squares, j, part);
            slope.col(k) = part / 3;
            if (fixed == kNoneFixed && count > 1 && gradient[k] > 0 &&
                part.maxCoeff() < kNegligible) {
                return {};
            }
        }
        if (!gradient.allFinite()) break;
        information = slope.transpose() * here.information * slope;
        MatrixXd damped = 2 * information;
        damped.diagonal() *= 1 + damping;
        damped.diagonal().array() += 1e-12 * damped.diagonal().maxCoeff();
        const auto factor = linear_algebra::Cholesky::of(damped);
        if (!factor) break;
        const VectorXd by =
            (-factor->solve(gradient)).cwiseMax(-kLongestStep).cwiseMin(kLongestStep);
        const Terms next = moved(by);
        Evaluated there = evaluate(next, true);
        if (there.deviance <= here.deviance) {
            squares = next;
            here = std::move(there);
            damping = std::max(1e-6, damping / 10);
        } else {
            damping *= 10;
        }
        if (std::abs(by.dot(gradient)) < (damping < kHeavy ? kSmallGain : kNoGain)) break;
    }
    TermFit fit{set, squares, {}, here.deviance, free.size()};
    const auto factor = linear_algebra::Cholesky::of(information);
    for (Index k = 0; k < count; ++k) {
        fit.log_sigma[free[static_cast<std::size_t>(k)]] =
            factor ? std::sqrt(factor->inverse()(k, k)) : std::numeric_limits<double>::infinity();
    }
    return fit;
}

std::optional<TermFit> CurveLikelihood::best(const TermSet& set) const {
    Terms start{};
    std::size_t count = 0;
    for (std::size_t j = 0; j < kTerms; ++j) {
        if (!set[j]) continue;
        start[j] = largest_square(j);
        ++count;
    }
    if (count == 0 || count > points_.size()) return {};
    const std::optional<TermFit> fit = minimise(set, start, kNoneFixed);
    if (!fit || !std::isfinite(fit->deviance) || (count > 1 && negligible(*fit))) return {};
    return fit;
}

double CurveLikelihood::profile(const TermFit& from, std::size_t at, double value) const {
    Terms squares = from.square;
    TermSet set = from.has;
    set[at] = true;
    squares[at] = value;
    return minimise(set, squares, at)->deviance;
}

}  // namespace vibrig::estimator::allan
