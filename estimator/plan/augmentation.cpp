#include "estimator/plan/augmentation.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/plan/algebra.hpp"

namespace vibrig::estimator::plan {

namespace {

/// Power of variance over target in the measure of what is missing: near the largest, yet smooth.
constexpr int kMissingPower = 6;
constexpr int kMostPasses = 12;
constexpr double kLeastGain = 1e-6;

using ByRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// In units of the targets, or of the present standard error where there is none.
class RunSearch {
  public:
    RunSearch(const std::vector<double>& covariance, const std::vector<Experiment>& experiments,
              const std::vector<double>& target)
        : p_(at(target.size())), wanted_(p_), scale_(p_) {
        const Matrix p0 = Eigen::Map<const ByRows>(covariance.data(), p_, p_);
        for (Eigen::Index i = 0; i < p_; ++i) {
            const double t = target[static_cast<std::size_t>(i)];
            wanted_[i] = t > 0 ? 1.0 : 0.0;
            scale_[i] = t > 0 ? t : std::sqrt(p0(i, i));
        }
        const Vector present = p0.diagonal().cwiseSqrt();
        // Inverted in units of the present standard errors, where it is best conditioned.
        const Matrix normal =
            present.cwiseInverse().asDiagonal() * p0 * present.cwiseInverse().asDiagonal();
        const auto factor = linear_algebra::Cholesky::of(normal);
        if (!factor) throw PlanError("covariance: found one that is not positive definite");
        const Vector change = scale_.cwiseQuotient(present);
        information_ = change.asDiagonal() * factor->inverse() * change.asDiagonal();
        for (const Experiment& experiment : experiments) {
            const Eigen::Map<const ByRows> rows(experiment.rows.data(),
                                                at(experiment.rows.size()) / p_, p_);
            rows_.emplace_back(rows * scale_.asDiagonal());
            cost_.push_back(experiment.cost);
        }
        invert();
    }

    [[nodiscard]] bool met() const {
        return (cov_.diagonal().cwiseProduct(wanted_)).maxCoeff() <= 1.0;
    }
    [[nodiscard]] double missing() const { return missing(cov_.diagonal()); }

    void add(std::size_t j) {
        information_ += linear_algebra::gram(rows_[j]);
        runs_.push_back(j);
        invert();
    }
    void remove(std::size_t k) {
        information_ -= linear_algebra::gram(rows_[runs_[k]]);
        runs_.erase(runs_.begin() + static_cast<std::ptrdiff_t>(k));
        invert();
    }

    /// Place in `choice` of the experiment that gains most per cost, in the logarithm of what is
    /// missing.
    [[nodiscard]] std::size_t best_of(const std::vector<std::size_t>& choice) const {
        std::size_t pick = 0;
        double highest = -1;
        const double now = std::log(missing());
        for (std::size_t k = 0; k < choice.size(); ++k) {
            const double gain = (now - std::log(missing(with(choice[k])))) / cost_[choice[k]];
            if (gain > highest) {
                highest = gain;
                pick = k;
            }
        }
        return pick;
    }

    /// Takes each run out in turn and puts the best one in instead.
    bool exchange() {
        bool better = false;
        for (std::size_t k = 0; k < runs_.size(); ++k) {
            const double before = missing();
            const std::size_t old = runs_[k];
            remove(k);
            std::size_t pick = old;
            double least = before * (1 - kLeastGain);
            for (std::size_t j = 0; j < rows_.size(); ++j) {
                const double m = cost_[j] <= cost_[old] * 1.2 ? missing(with(j)) : least;
                if (m < least) {
                    least = m;
                    pick = j;
                }
            }
            add(pick);
            std::rotate(runs_.begin() + static_cast<std::ptrdiff_t>(k), runs_.end() - 1,
                        runs_.end());
            better = better || pick != old;
        }
        return better;
    }

    /// The run that is missed least.
    [[nodiscard]] std::size_t least_useful() {
        std::size_t pick = 0;
        double least = -1;
        for (std::size_t k = 0; k < runs_.size(); ++k) {
            const Matrix cov = inverse(information_ - linear_algebra::gram(rows_[runs_[k]]));
            const double m = missing(cov.diagonal());
            if (least < 0 || m < least) {
                least = m;
                pick = k;
            }
        }
        return pick;
    }

    [[nodiscard]] const std::vector<std::size_t>& runs() const { return runs_; }
    [[nodiscard]] std::vector<double> sigma() const {
        const Vector s = cov_.diagonal().cwiseSqrt().cwiseProduct(scale_);
        return {s.begin(), s.end()};
    }

  private:
    void invert() { cov_ = inverse(information_); }
    static Matrix inverse(const Matrix& information) {
        const auto factor = linear_algebra::Cholesky::of(information);
        if (!factor) throw PlanError("augmentation: the information is not positive definite");
        return factor->inverse();
    }
    /// Variances with one more run.
    [[nodiscard]] Vector with(std::size_t j) const {
        const Matrix& r = rows_[j];
        const Matrix k = linear_algebra::product(r, cov_);
        const Matrix s =
            Matrix::Identity(r.rows(), r.rows()) + linear_algebra::product(r, k.transpose());
        // The identity keeps it positive definite.
        const Matrix gain = linear_algebra::Cholesky::of(s).value().solve(k);
        return cov_.diagonal() - k.cwiseProduct(gain).colwise().sum().transpose();
    }
    [[nodiscard]] double missing(const Vector& variance) const {
        return (variance.array().max(0.0).pow(kMissingPower) * wanted_.array()).sum();
    }

    Eigen::Index p_;
    Vector wanted_, scale_;
    Matrix information_, cov_;
    std::vector<Matrix> rows_;
    std::vector<double> cost_;
    std::vector<std::size_t> runs_;
};

}  // namespace

Augmentation augment(const std::vector<double>& covariance,
                     const std::vector<Experiment>& experiments, const std::vector<double>& target,
                     std::size_t at_most) {
    const std::size_t p = target.size();
    const auto fits = [p](const Experiment& e) {
        return !e.rows.empty() && e.rows.size() % p == 0 && e.cost > 0;
    };
    if (p == 0 || covariance.size() != p * p || experiments.empty() ||
        !std::all_of(experiments.begin(), experiments.end(), fits)) {
        throw PlanError("augmentation: sizes of covariance, runs and targets do not fit");
    }
    const bool asked = std::any_of(target.begin(), target.end(), [](double t) { return t > 0; });
    RunSearch search(covariance, experiments, target);
    std::vector<std::size_t> all(experiments.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    Augmentation result;
    if (asked) {
        while (!search.met() && search.runs().size() < at_most) {
            search.add(all[search.best_of(all)]);
        }
        const auto improve = [&] {
            for (int pass = 0; pass < kMostPasses; ++pass) {
                const RunSearch before = search;
                if (!search.exchange()) return;
                // Less is missing over all, yet perhaps one target that was met.
                if (before.met() && !search.met()) {
                    search = before;
                    return;
                }
            }
        };
        improve();
        // As few as will do.
        while (search.met() && !search.runs().empty()) {
            const RunSearch before = search;
            search.remove(search.least_useful());
            improve();
            if (!search.met()) {
                search = before;
                break;
            }
        }
    }
    result.met = !asked || search.met();
    result.sigma = search.sigma();
    result.runs = search.runs();
    // The most informative first, as seen from where the covariance is now.
    RunSearch again(covariance, experiments, target);
    std::vector<std::size_t> left = result.runs;
    result.runs.clear();
    while (!left.empty()) {
        const std::size_t pick = again.best_of(left);
        result.runs.push_back(left[pick]);
        again.add(left[pick]);
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(pick));
    }
    return result;
}

std::vector<double> covariance_after(const std::vector<double>& prior,
                                     const std::vector<Experiment>& experiments,
                                     const std::vector<double>& done) {
    const auto p = at(prior.size());
    const Eigen::Map<const Vector> sigma(prior.data(), p);
    // In units of the prior.
    Matrix information = Matrix::Identity(p, p);
    for (std::size_t j = 0; j < done.size(); ++j) {
        if (done[j] <= 0) continue;
        const auto& rows = experiments[j].rows;
        for (std::size_t begin = 0; begin < rows.size(); begin += prior.size()) {
            const Vector row = Eigen::Map<const Vector>(rows.data() + begin, p).cwiseProduct(sigma);
            information += done[j] * row * row.transpose();
        }
    }
    const auto factor = linear_algebra::Cholesky::of(information);
    if (!factor) throw PlanError("the runs done: their information is not finite");
    const Matrix covariance = sigma.asDiagonal() * factor->inverse() * sigma.asDiagonal();
    return {covariance.data(), covariance.data() + covariance.size()};
}

}  // namespace vibrig::estimator::plan
