#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/spectrum/resonance.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector4d;
using Eigen::VectorXd;
using linear_algebra::Cholesky;

constexpr Index kLinearColumns = kBase + 2 * kElastic, kNonlinear = 4;

/// Both resonances: ln hz of each, then ln damping.
std::vector<Resonance> resonances_at(const Vector4d& p) {
    return {{std::exp(p[0]), std::exp(p[2])}, {std::exp(p[1]), std::exp(p[3])}};
}

class TwoResonances {
  public:
    TwoResonances(const SpectralTable& table, std::size_t gyro, const GyroProblem& problem)
        : table_(table),
          gyro_(gyro),
          factor_(Cholesky::or_nan(problem.covariance)),
          swept_(problem.swept),
          rate_(factor_.whiten(problem.rate)),
          information_(kLinearColumns) {
        for (const SweptRates& swept : swept_) {
            rate_.conservativeResize(rate_.size() + swept.size());
            rate_.tail(swept.size()) = swept.rate();
        }
        information_.head(kBase) = problem.prior_sigma.array().square().inverse();
        information_.tail(2 * kElastic).setConstant(std::pow(kElasticSizes.back(), -2));
    }

    struct At {
        Vector4d p;
        VectorXd x;
        MatrixXd columns;  ///< whitened, n x 22
        double objective = 0;
    };
    [[nodiscard]] At at(const Vector4d& p) const {
        At out{p, {}, whitened(p), 0};
        MatrixXd normal = linear_algebra::gram(out.columns);
        normal.diagonal() += information_;
        out.x = Cholesky::or_nan(normal).solve(out.columns.transpose() * rate_);
        out.objective = (rate_ - out.columns * out.x).squaredNorm() +
                        out.x.cwiseAbs2().dot(information_) + off_prior(p).squaredNorm();
        return out;
    }

    /// Normal equations of all 26, and the slope of half the objective.
    [[nodiscard]] std::pair<MatrixXd, VectorXd> normal(const At& here) const {
        MatrixXd j(rate_.size(), kLinearColumns + kNonlinear);
        j.leftCols(kLinearColumns) = here.columns;
        constexpr double kStep = 1e-5;
        for (Index i = 0; i < kNonlinear; ++i) {
            const Vector4d step = kStep * Vector4d::Unit(i);
            j.col(kLinearColumns + i) =
                (whitened(here.p + step) - whitened(here.p - step)) * here.x / (2 * kStep);
        }
        MatrixXd all = linear_algebra::gram(j);
        all.diagonal().head(kLinearColumns) += information_;
        all.diagonal().tail(2).array() += std::pow(kDampingSpread, -2);
        VectorXd slope = j.transpose() * (rate_ - here.columns * here.x);
        slope.head(kLinearColumns) -= information_.cwiseProduct(here.x);
        slope.tail(2) -= off_prior(here.p) / kDampingSpread;
        return {all, slope};
    }

    [[nodiscard]] static bool inside(const Vector4d& p) {
        const auto in = [](double ln_hz) {
            return ln_hz > std::log(kLowestResonance) && ln_hz < std::log(kHighestResonance);
        };
        return in(p[0]) && in(p[1]) && p.tail<2>().cwiseAbs().maxCoeff() < 12;
    }

  private:
    [[nodiscard]] MatrixXd whitened(const Vector4d& p) const {
        const auto resonances = resonances_at(p);
        MatrixXd out(rate_.size(), kLinearColumns);
        Index row = table_.dwells();
        out.topRows(row) = factor_.whiten(design(table_, gyro_, resonances));
        for (const SweptRates& swept : swept_) {
            out.middleRows(row, swept.size()) = swept_design(swept, resonances);
            row += swept.size();
        }
        return out;
    }
    [[nodiscard]] static Eigen::Vector2d off_prior(const Vector4d& p) {
        return (p.tail<2>().array() - std::log(kDamping)) / kDampingSpread;
    }
    const SpectralTable& table_;
    std::size_t gyro_;
    Cholesky factor_;
    const std::vector<SweptRates>& swept_;
    VectorXd rate_, information_;  ///< of the dwells, then of the sweeps; whitened
};

/// Gauss and Newton's method, damped where it overshoots.
TwoResonances::At descend(const TwoResonances& problem, const Vector4d& start) {
    TwoResonances::At here = problem.at(start);
    double damping = 1e-2;
    for (int step = 0; step < 60 && damping < 1e8; ++step) {
        auto [normal, slope] = problem.normal(here);
        normal.diagonal().tail(kNonlinear) *= 1 + damping;
        const VectorXd change = Cholesky::or_nan(normal).solve(slope);
        const Vector4d p = here.p + change.tail<4>();
        std::optional<TwoResonances::At> next;
        if (change.tail<4>().cwiseAbs().maxCoeff() < 1 && TwoResonances::inside(p))
            next = problem.at(p);
        if (next && next->objective < here.objective) {
            const bool done = here.objective - next->objective < 1e-7;
            here = std::move(*next);
            damping = std::max(1e-9, damping / 5);
            if (done) break;
        } else {
            damping *= 8;
        }
    }
    return here;
}

}  // namespace

Mixture two_resonances(const SpectralTable& table, std::size_t gyro, const GyroProblem& problem,
                       double first_hz) {
    const TwoResonances of(table, gyro, problem);
    std::optional<TwoResonances::At> best;
    for (const double first : {first_hz, 32.0, 55.0}) {
        for (const double second : {80.0, 110.0}) {
            Vector4d start;
            start << std::log(first), std::log(second), std::log(kDamping), std::log(kDamping);
            TwoResonances::At found = descend(of, start);
            if (!best || found.objective < best->objective) best = std::move(found);
        }
    }
    Mixture out;
    const MatrixXd normal = of.normal(*best).first;
    out.list.push_back(
        {1, resonances_at(best->p), best->x, linear_algebra::positive_inverse(normal), true});
    const VectorXd left = problem.rate - design(table, gyro, out.list[0].resonances) * best->x;
    out.chi_square = linear_algebra::squared_distance(problem.covariance, left);
    out.degrees = static_cast<int>(problem.rate.size() - kLinearColumns - kNonlinear);
    if (problem.swept.empty()) return out;
    // What sweeps determine takes nothing from the dwells' rates.
    const MatrixXd x = design(table, gyro, out.list[0].resonances);
    out.degrees =
        static_cast<int>(std::lround(static_cast<double>(problem.rate.size()) -
                                     (gain(table, gyro, problem, out.list[0]) * x).trace()));
    return out;
}

}  // namespace vibrig::estimator::spectrum
