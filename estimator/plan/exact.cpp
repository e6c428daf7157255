#include "estimator/plan/exact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/plan/algebra.hpp"
#include "estimator/plan/evaluation.hpp"

namespace vibrig::estimator::plan {

namespace {

/// An exchange that gains less is rounding.
constexpr double kLeastFactor = 1e-9;
constexpr int kRefactor = 20;
constexpr double kRidge = 1e-6;
/// Multiply-adds of all starts together, roughly.
constexpr double kStartsWork = 6e8;

class Fedorov {
  public:
    Fedorov(const Matrix& g, Matrix kept, Vector cost, double kept_cost)
        : g_(g), kept_(std::move(kept)), cost_(std::move(cost)), kept_cost_(kept_cost) {
        costs_ = cost_.maxCoeff() > cost_.minCoeff();
    }

    void start(std::size_t runs, std::mt19937_64& random) {
        std::uniform_int_distribution<Eigen::Index> any(0, g_.rows() - 1);
        const auto p = g_.cols();
        information_ = kept_ + kRidge * Matrix::Identity(p, p);
        in_plan_.clear();
        // Half at random, the other half where least is known: rarely singular, never the same.
        for (std::size_t k = 0; k < runs; ++k) {
            Eigen::Index i = any(random);
            if (k >= runs / 2) {
                // The ridge keeps it positive definite.
                inverse_ = linear_algebra::Cholesky::of(information_).value().inverse();
                (g_ * inverse_).cwiseProduct(g_).rowwise().sum().maxCoeff(&i);
            }
            in_plan_.push_back(i);
            information_ += g_.row(i).transpose() * g_.row(i);
        }
    }

    /// Returns log det, of the information per cost where runs cost more or less; -infinity if the
    /// plan is singular.
    double climb() {
        for (int swaps = 0;; ++swaps) {
            if (swaps % kRefactor == 0 && !refactor()) {
                return -std::numeric_limits<double>::infinity();
            }
            if (!swap_best()) break;
        }
        if (!refactor()) return -std::numeric_limits<double>::infinity();
        return log_det_ - (costs_ ? coefficients() * std::log(total_cost()) : 0);
    }

    [[nodiscard]] Counts counts() const {
        Counts result(static_cast<std::size_t>(g_.rows()), 0);
        for (const Eigen::Index i : in_plan_) ++result[static_cast<std::size_t>(i)];
        return result;
    }

  private:
    [[nodiscard]] double coefficients() const { return static_cast<double>(g_.cols()); }
    [[nodiscard]] double total_cost() const {
        double total = kept_cost_;
        for (const Eigen::Index i : in_plan_) total += cost_[i];
        return total;
    }

    bool refactor() {
        information_ = kept_;
        for (const Eigen::Index i : in_plan_) information_ += g_.row(i).transpose() * g_.row(i);
        const auto factor = linear_algebra::Cholesky::of(information_);
        if (!factor || !(factor->least_pivot() > 1e-9)) return false;
        log_det_ = factor->log_det();
        inverse_ = factor->inverse();
        return true;
    }

    bool swap_best() {
        const Matrix gw = linear_algebra::product(g_, inverse_);
        const Vector d = gw.cwiseProduct(g_).rowwise().sum();
        const double total = total_cost();
        double best = 1 + kLeastFactor;
        std::size_t out = in_plan_.size();
        Eigen::Index in = 0;
        Eigen::Index before = -1;
        for (std::size_t k = 0; k < in_plan_.size(); ++k) {
            const Eigen::Index i = in_plan_[k];
            if (i == before) continue;
            before = i;
            const Vector dij = gw * g_.row(i).transpose();
            Eigen::Index j = 0;
            Vector gain = 1 + d.array() - d[i] - (d[i] * d.array() - dij.array().square());
            if (costs_) {
                gain.array() *= (total / (total - cost_[i] + cost_.array())).pow(coefficients());
            }
            const double factor = gain.maxCoeff(&j);
            if (factor > best) {
                best = factor;
                out = k;
                in = j;
            }
        }
        if (out == in_plan_.size()) return false;
        // One in, one out, each by Sherman and Morrison's formula.
        for (const auto& [row, sign] : {std::pair{in, 1.0}, std::pair{in_plan_[out], -1.0}}) {
            const Vector w = inverse_ * g_.row(row).transpose();
            inverse_ -= sign / (1 + sign * g_.row(row).dot(w)) * w * w.transpose();
        }
        in_plan_[out] = in;
        std::sort(in_plan_.begin(), in_plan_.end());
        return true;
    }

    const Matrix& g_;
    Matrix kept_, information_, inverse_;
    Vector cost_;
    double kept_cost_;
    bool costs_ = false;  ///< not all the same
    std::vector<Eigen::Index> in_plan_;
    double log_det_ = 0;
};

}  // namespace

Effort effort_of(const Counts& counts) { return {counts.begin(), counts.end()}; }

Counts exact_design(const Problem& problem, std::size_t runs, const ExactSearch& search) {
    Vector scale;
    const Matrix g = scaled_rows(problem, scale);
    Matrix kept = Matrix::Zero(g.cols(), g.cols());
    std::size_t done = 0;
    for (std::size_t i = 0; i < search.done.size(); ++i) {
        kept += search.done[i] * g.row(at(i)).transpose() * g.row(at(i));
        if (search.done[i] > 0) ++done;
    }
    if (runs + done < problem.coefficients()) {
        const std::size_t needed = problem.coefficients();
        throw PlanError(
            "--runs: found " + std::to_string(runs) + ", expected " +
            std::to_string(needed - done) + " at least for " + std::to_string(needed) +
            " coefficients" +
            (done > 0 ? " with " + std::to_string(done) + " points that are done" : ""));
    }
    std::size_t starts = search.starts;
    if (starts == 0) {
        const double work = static_cast<double>(g.size()) * static_cast<double>(runs * runs);
        starts = static_cast<std::size_t>(std::clamp(kStartsWork / work, 20.0, 300.0));
    }
    std::mt19937_64 random(search.seed);
    Vector cost(g.rows());
    double kept_cost = 0;
    for (std::size_t i = 0; i < problem.size(); ++i) {
        cost[at(i)] = problem.points[i].cost;
        if (i < search.done.size()) kept_cost += search.done[i] * cost[at(i)];
    }
    Fedorov fedorov(g, kept, cost, kept_cost);
    Counts best;
    double highest = -std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < starts; ++n) {
        fedorov.start(runs, random);
        const double log_det = fedorov.climb();
        if (log_det > highest + 1e-12) {
            highest = log_det;
            best = fedorov.counts();
        }
    }
    if (best.empty()) {
        const Evaluation all = evaluate(problem, Effort(problem.size(), 1.0));
        throw PlanError("no plan of " + std::to_string(runs) +
                        " runs determines all coefficients; over all candidates the rank is " +
                        std::to_string(all.rank) + " of " + std::to_string(all.coefficients) +
                        (all.identifies_all() ? "" : ": not determined are " + all.undetermined()));
    }
    return best;
}

}  // namespace vibrig::estimator::plan
