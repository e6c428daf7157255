#include "tests/unit/estimator/uncertainty/naming.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/uncertainty/budget.hpp"
#include "estimator/uncertainty/fit.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using uncertainty::Misfit;

constexpr double kNamedFrom = 4;

/// Places of a step that share its odds.
double places_of(Misfit misfit, std::size_t dwells) {
    const auto n = static_cast<double>(dwells);
    return misfit == Misfit::step ? n - 3 : misfit == Misfit::unbalance_step ? n - 5 : 1;
}

/// In the unknowns' eigenvectors, where s is normal about f p with variance f: how often
/// log mean over q of exp(-1/2 sum log(1 + q^2 f) + 1/2 sum s^2/(f + 1/q^2)) is above `limit`.
double probability_above(double limit, const VectorXd& f, const VectorXd& p) {
    constexpr int kDraws = 20000;
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    int above = 0;
    for (int n = 0; n < kDraws; ++n) {
        VectorXd s(f.size());
        for (Index i = 0; i < f.size(); ++i) s[i] = f[i] * p[i] + std::sqrt(f[i]) * normal(random);
        double mean = 0;
        for (const double q : {1.0, 4.0, 16.0}) {
            double log_odds = 0;
            for (Index i = 0; i < f.size(); ++i)
                log_odds += 0.5 * (s[i] * s[i] / (f[i] + 1 / (q * q)) - std::log(1 + q * q * f[i]));
            mean += std::exp(log_odds - limit) / 3;
        }
        above += mean > 1 ? 1 : 0;
    }
    return static_cast<double>(above) / kDraws;
}

}  // namespace

Naming naming(const std::vector<PlannedRow>& plan, Misfit misfit,
              const std::vector<double>& unknowns, int after_dwell) {
    const Settings settings;
    const std::vector<DwellRow> rows = theory_rows(settings, plan);
    const auto table = uncertainty::dwell_table(rows);
    ParameterArray truth{};
    for (std::size_t i = 0; i < kParameters; ++i) truth[internal_of(i)] = kTable2[i];
    const uncertainty::ForwardModel model(settings, truth);
    const auto inputs =
        uncertainty::input_signatures(settings.uncertainty, settings.drift, table, model);
    const VectorXd u =
        uncertainty::input_covariance(settings.uncertainty, inputs.list).diagonal().cwiseSqrt();
    const uncertainty::NullFit fit(table, inputs.rates * u.asDiagonal(), VectorXd::Zero(30));
    const auto of =
        uncertainty::signatures(misfit, table, model, std::sqrt(kRateVariance), after_dwell);
    VectorXd p(of.z.cols());
    for (Index i = 0; i < p.size(); ++i) p[i] = unknowns.at(static_cast<std::size_t>(i)) / of.size;

    Naming out;
    const VectorXd z = of.z * p;
    const VectorXd shift = fit.change(z).cwiseQuotient(fit.covariance().diagonal().cwiseSqrt());
    for (std::size_t i = 0; i < kParameters; ++i)
        out.shift[i] = shift[static_cast<Index>(internal_of(i))];
    out.rates = z;
    out.chi_square = fit.project(z).f(0, 0);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(fit.project(of.z).f);
    out.probability =
        probability_above(kNamedFrom + std::log(places_of(misfit, rows.size())),
                          eigen.eigenvalues().cwiseMax(0.0), eigen.eigenvectors().transpose() * p);
    return out;
}

int least_of(int trials, double probability) {
    probability = std::min(probability, 1 - 1e-9);
    double below = 0, one = std::pow(1 - probability, trials);
    int k = 0;
    while (k < trials && below + one <= 1e-3) {
        below += one;
        one *= static_cast<double>(trials - k) / (k + 1) * probability / (1 - probability);
        ++k;
    }
    return k;
}

}  // namespace vibrig::estimator::testing
