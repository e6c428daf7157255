#include "estimator/plan/optimum.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/plan/algebra.hpp"
#include "estimator/plan/evaluation.hpp"

namespace vibrig::estimator::plan {

namespace {

/// A share below this is none: it can no longer change the determinant.
constexpr double kNoShare = 1e-12;
constexpr int kEPower = 60;  ///< of Kiefer's criterion, for E
/// Multiply-adds that the slowly converging A and E iterations may cost.
constexpr double kKieferWork = 1e8;

/// Rows for the equal-cost problem: information per unit of effort.
Matrix per_effort(const Problem& problem, Matrix g) {
    for (std::size_t i = 0; i < problem.size(); ++i) {
        g.row(at(i)) /= std::sqrt(problem.points[i].cost);
    }
    return g;
}

class DSearch {
  public:
    explicit DSearch(Matrix g)
        : g_(std::move(g)),
          p_(static_cast<double>(g_.cols())),
          candidates_(static_cast<std::size_t>(g_.rows())),
          share_(Vector::Constant(g_.rows(), 1.0 / static_cast<double>(g_.rows()))) {
        std::iota(candidates_.begin(), candidates_.end(), Eigen::Index{0});
    }

    /// Brings the inverse and all variances up to date; returns max d - p.
    double refresh() {
        const Matrix information = linear_algebra::gram(share_.cwiseSqrt().asDiagonal() * g_);
        const auto factor = linear_algebra::Cholesky::of(information);
        if (!factor) throw PlanError("the search left the plans that determine the coefficients");
        inverse_ = factor->inverse();
        log_det_ = factor->log_det();
        d_.resize(g_.rows());
        for (const Eigen::Index i : candidates_) d_[i] = variance(i, i);
        best_ = *std::max_element(candidates_.begin(), candidates_.end(),
                                  [&](auto a, auto b) { return d_[a] < d_[b]; });
        return d_[best_] - p_;
    }

    /// Points that no optimal design uses (Harman and Pronzato, Statistics and Probability Letters
    /// 77, 2007, 90-94).
    void drop_hopeless() {
        const double e = std::max(0.0, d_[best_] - p_);
        const double least = p_ * (1 + e / 2 - std::sqrt(e * (4 + e - 4 / p_)) / 2);
        double dropped = 0;
        std::erase_if(candidates_, [&](Eigen::Index i) {
            if (d_[i] >= least * (1 - 1e-9)) return false;
            dropped += share_[i];
            share_[i] = 0;
            return true;
        });
        if (dropped > 0) share_ /= 1 - dropped;
    }

    void exchange_vertex() {
        const auto support = supported();
        const auto worst = *std::min_element(support.begin(), support.end(),
                                             [&](auto a, auto b) { return d_[a] < d_[b]; });
        exchange(best_, worst);
    }

    void exchange_neighbours() {
        const auto support = supported();
        for (std::size_t k = 0; k + 1 < support.size(); ++k) exchange(support[k], support[k + 1]);
    }

    void multiply() {
        double sum = 0;
        for (const Eigen::Index i : candidates_) {
            share_[i] *= variance(i, i);
            if (share_[i] < kNoShare) share_[i] = 0;
            sum += share_[i];
        }
        share_ /= sum;
    }

    [[nodiscard]] const Vector& share() const { return share_; }
    [[nodiscard]] double log_det() const { return log_det_; }

  private:
    [[nodiscard]] double variance(Eigen::Index i, Eigen::Index j) const {
        return g_.row(i).dot(inverse_ * g_.row(j).transpose());
    }
    [[nodiscard]] std::vector<Eigen::Index> supported() const {
        std::vector<Eigen::Index> list;
        std::copy_if(candidates_.begin(), candidates_.end(), std::back_inserter(list),
                     [&](Eigen::Index i) { return share_[i] > 0; });
        return list;
    }
    /// Moves the best amount of share between two points, either way.
    void exchange(Eigen::Index to, Eigen::Index from) {
        if (to == from) return;
        const Vector wi = inverse_ * g_.row(to).transpose();
        const Vector wj = inverse_ * g_.row(from).transpose();
        const double di = g_.row(to).dot(wi), dj = g_.row(from).dot(wj), dij = g_.row(to).dot(wj);
        const double curvature = di * dj - dij * dij;
        double amount = (di - dj) / 2;
        amount = curvature > 1e-12 * di * dj ? amount / curvature
                                             : (amount > 0 ? share_[from] : -share_[to]);
        amount = std::clamp(amount, -share_[to], share_[from]);
        if (amount == 0) return;
        share_[to] += amount;
        share_[from] -= amount;
        // det M changes by this factor; the inverse by the rank-two formula.
        const double factor = 1 + amount * (di - dj) - amount * amount * curvature;
        inverse_ -= (amount * (1 - amount * dj) * wi * wi.transpose() -
                     amount * (1 + amount * di) * wj * wj.transpose() +
                     amount * amount * dij * (wi * wj.transpose() + wj * wi.transpose())) /
                    factor;
    }

    Matrix g_;
    double p_;
    std::vector<Eigen::Index> candidates_;
    Vector share_, d_;
    Matrix inverse_;
    double log_det_ = 0;
    Eigen::Index best_ = 0;
};

void require_full_rank(const Problem& problem) {
    const Evaluation all = evaluate(problem, Effort(problem.size(), 1.0));
    if (all.identifies_all()) return;
    throw PlanError("the candidates have rank " + std::to_string(all.rank) + " of " +
                    std::to_string(all.coefficients) + ": not determined are " +
                    all.undetermined());
}

/// Kiefer's criterion [tr M^-q]^(1/q), minimised by w_i <- w_i phi_i^(1 / (q + 1)).
template <class Visit>
void kiefer(const Problem& problem, int q, const Visit& visit) {
    require_full_rank(problem);
    const Matrix g = per_effort(problem, rows(problem.points, problem.terms));
    Vector share = Vector::Constant(g.rows(), 1.0 / static_cast<double>(g.rows()));
    const double work = static_cast<double>(g.size() * g.cols());
    const auto most = static_cast<std::size_t>(std::clamp(kKieferWork / work, 200.0, 5000.0));
    for (std::size_t n = 0; n < most; ++n) {
        const Matrix information = linear_algebra::gram(share.cwiseSqrt().asDiagonal() * g);
        const auto eigen = linear_algebra::symmetric_eigen(information);
        const Vector& lambda = eigen.values;
        // Relative to the smallest eigenvalue, so that high powers stay finite.
        const Vector power = (lambda[0] / lambda.array()).pow(q + 1);
        const Matrix y = linear_algebra::product(g, eigen.vectors);
        const Vector phi = y.cwiseAbs2() * power;
        if (visit(lambda, power, phi.maxCoeff())) return;
        share = share.array() * phi.array().pow(1.0 / (q + 1));
        share /= share.sum();
    }
}

}  // namespace

Optimum d_optimum(const Problem& problem, double gap, std::size_t most_iterations) {
    require_full_rank(problem);
    Vector scale;
    DSearch search(per_effort(problem, scaled_rows(problem, scale)));
    Optimum result;
    for (;; ++result.iterations) {
        result.gap = search.refresh();
        if (result.gap < gap || result.iterations == most_iterations) break;
        search.drop_hopeless();
        search.refresh();
        search.exchange_vertex();
        search.exchange_neighbours();
        search.multiply();
    }
    const auto p = static_cast<double>(problem.coefficients());
    result.bound = p / (p + std::max(0.0, result.gap));
    result.log_det = search.log_det() + 2 * scale.array().log().sum();
    result.share.assign(search.share().begin(), search.share().end());
    return result;
}

Bracket a_optimum(const Problem& problem) {
    Bracket best;
    kiefer(problem, 1, [&](const Vector& lambda, const Vector&, double largest) {
        const double trace = lambda.cwiseInverse().sum();
        const double phi = largest / (lambda[0] * lambda[0]);
        if (best.value == 0 || trace < best.value) best.value = trace;
        best.lower_bound = std::max(best.lower_bound, trace * trace / phi);
        return best.lower_bound > (1 - 1e-6) * best.value;
    });
    return best;
}

Bracket e_optimum(const Problem& problem) {
    Bracket best;
    kiefer(problem, kEPower, [&](const Vector& lambda, const Vector& power, double largest) {
        const double value = 1 / lambda[0];
        if (best.value == 0 || value < best.value) best.value = value;
        // Duality: smallest eigenvalue of any design <= max f' E f for every E >= 0, tr E = 1.
        best.lower_bound = std::max(best.lower_bound, power.sum() / largest);
        return best.lower_bound > 0.99 * best.value;
    });
    return best;
}

}  // namespace vibrig::estimator::plan
