#include "estimator/allan/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

#include "estimator/linear_algebra.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr int kReweightings = 12;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, static_cast<int>(kTerms)>;
using Vector = Eigen::VectorXd;
using Squares = Eigen::Matrix<double, static_cast<int>(kTerms), 1>;  // squared coefficients

struct Solution {
    Squares squares = Squares::Zero();
    Squares sigma = Squares::Zero();
};

/// With five unknowns every set of non-zero terms can be tried: the best feasible one is the
/// non-negative least-squares solution, without an iteration that could stall.
Solution non_negative(const Matrix& a, const Vector& b, const std::array<bool, kTerms>& wanted) {
    Solution best;
    double least = b.squaredNorm();
    for (unsigned set = 1; set < (1U << kTerms); ++set) {
        std::vector<int> columns;
        for (unsigned j = 0; j < kTerms; ++j) {
            if ((set >> j & 1U) != 0 && wanted[j]) {
                columns.push_back(static_cast<int>(j));
            } else if ((set >> j & 1U) != 0) {
                columns.assign(kTerms + 1, 0);
            }
        }
        const auto count = static_cast<Eigen::Index>(columns.size());
        if (count > static_cast<Eigen::Index>(kTerms) || count > a.rows()) {
            continue;
        }
        Eigen::MatrixXd part = a(Eigen::all, columns);
        // Columns differ by many decades in scale.
        const Vector scale = part.colwise().norm();
        if (!(scale.minCoeff() > 0)) {
            continue;
        }
        part = part * scale.cwiseInverse().asDiagonal();
        const Vector x = linear_algebra::least_squares(part, b);
        const double rest = (part * x - b).squaredNorm();
        if (!x.allFinite() || x.minCoeff() <= 0 || rest >= least) {
            continue;
        }
        least = rest;
        best = {};
        const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(count, count);
        const Eigen::MatrixXd covariance =
            linear_algebra::least_squares(linear_algebra::gram(part), unit);
        for (Eigen::Index k = 0; k < count; ++k) {
            best.squares[columns[static_cast<std::size_t>(k)]] = x[k] / scale[k];
            best.sigma[columns[static_cast<std::size_t>(k)]] =
                std::sqrt(covariance(k, k)) / scale[k];
        }
    }
    return best;
}

double edf_at(const VariancePoint& point, const Terms& terms, std::size_t points) {
    return std::max(1.0, point.share * edf(Statistic::oadev, dominant_noise(terms, point.tau),
                                           points, point.m));
}

void note_ramp(Fit& fit, double record_h) {
    const FittedTerm& k = fit.terms[static_cast<std::size_t>(Term::K)];
    FittedTerm& r = fit.terms[static_cast<std::size_t>(Term::R)];
    const double walk = k.detected ? k.value : 0;
    // A ramp is known no better than the walk over the record lets it: K / sqrt(T).
    const double bound = walk / std::sqrt(record_h);
    if (!(bound > 0)) {
        return;
    }
    r.sigma = r.detected ? std::max(r.sigma, bound) : r.sigma;
    r.below = r.detected ? r.below : std::max(r.below, bound);
    if (!r.detected || r.value < 2 * bound) {
        std::ostringstream note;
        note.precision(3);
        note << "R is known no better than K/sqrt(T) = " << bound << " deg/h^2 in this record of "
             << record_h << " h";
        if (r.detected) {
            note << "; a record of " << 4 * walk * walk / (r.value * r.value)
                 << " h would show it at two standard errors";
        }
        fit.ramp_note = note.str();
    }
}

}  // namespace

double term_variance(Term term, double tau) {
    switch (term) {
        case Term::Q:
            return 3 / (tau * tau);
        case Term::N:
            return 3600 / tau;
        case Term::B:
            return 2 * std::numbers::ln2 / std::numbers::pi;
        case Term::K:
            return tau / (3 * 3600.0);
        case Term::R:
            return tau * tau / (2 * 3600.0 * 3600.0);
    }
    return 0;
}

double model_variance(const Terms& terms, double tau) {
    double sum = 0;
    for (std::size_t j = 0; j < kTerms; ++j) {
        sum += terms[j] * terms[j] * term_variance(static_cast<Term>(j), tau);
    }
    return sum;
}

Alpha dominant_noise(const Terms& terms, double tau) {
    // A ramp is not noise: what it covers is judged as random walk.
    constexpr std::array<Alpha, kTerms> kAlpha{2, 0, -1, -2, -2};
    std::size_t most = 1;
    double largest = 0;
    for (std::size_t j = 0; j < kTerms; ++j) {
        const double part = terms[j] * terms[j] * term_variance(static_cast<Term>(j), tau);
        if (part > largest) {
            largest = part;
            most = j;
        }
    }
    return kAlpha[most];
}

Terms Fit::values() const {
    Terms values{};
    for (std::size_t j = 0; j < kTerms; ++j) {
        values[j] = terms[j].detected ? terms[j].value : 0;
    }
    return values;
}

Fit fit_noise(std::span<const VariancePoint> curve, std::size_t points, double tau0,
              const std::array<bool, kTerms>& wanted) {
    const auto rows = static_cast<Eigen::Index>(curve.size());
    if (rows < 2) {
        throw DataError("fit: a curve of " + std::to_string(rows) +
                        " points found, at least 2 needed");
    }
    Vector model(rows);
    Vector weight(rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
        model[i] = curve[static_cast<std::size_t>(i)].variance;
    }
    Terms terms{};
    Solution solution;
    for (int round = 0; round <= kReweightings; ++round) {
        Matrix a(rows, static_cast<int>(kTerms));
        Vector b(rows);
        for (Eigen::Index i = 0; i < rows; ++i) {
            const VariancePoint& point = curve[static_cast<std::size_t>(i)];
            weight[i] = model[i] > 0 ? std::sqrt(edf_at(point, terms, points) / 2) / model[i] : 0;
            b[i] = weight[i] * point.variance;
            for (std::size_t j = 0; j < kTerms; ++j) {
                a(i, static_cast<Eigen::Index>(j)) =
                    weight[i] * term_variance(static_cast<Term>(j), point.tau);
            }
        }
        solution = non_negative(a, b, wanted);
        for (std::size_t j = 0; j < kTerms; ++j) {
            terms[j] = std::sqrt(solution.squares[static_cast<Eigen::Index>(j)]);
        }
        for (Eigen::Index i = 0; i < rows; ++i) {
            model[i] = model_variance(terms, curve[static_cast<std::size_t>(i)].tau);
        }
    }
    Fit fit;
    for (std::size_t j = 0; j < kTerms; ++j) {
        FittedTerm& term = fit.terms[j];
        term.value = terms[j];
        term.detected = terms[j] > 0;
        // d(c^2) = 2 c dc
        term.sigma =
            term.detected ? solution.sigma[static_cast<Eigen::Index>(j)] / (2 * terms[j]) : 0;
        double below = kInfinity;
        for (Eigen::Index i = 0; i < rows; ++i) {
            const double tau = curve[static_cast<std::size_t>(i)].tau;
            below = std::min(below, 1 / (weight[i] * term_variance(static_cast<Term>(j), tau)));
        }
        term.below = std::sqrt(below);
    }
    note_ramp(fit, static_cast<double>(points - 1) * tau0 / 3600);
    return fit;
}

}  // namespace vibrig::estimator::allan
