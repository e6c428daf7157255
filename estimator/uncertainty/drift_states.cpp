#include "estimator/uncertainty/drift_states.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/drift_hypotheses.hpp"
#include "estimator/uncertainty/rates_covariance.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Unbalance = DriftHypothesis::Unbalance;

constexpr double kStepSize = 12.0;      ///< prior size of a step, in s0
constexpr double kUnbalanceSize = 8.0;  ///< in s0 / g
constexpr Index kFirstLinear = 1;       ///< of the three linear terms
constexpr double kLeastWeight = 1e-12;  ///< less moves no digit
constexpr double kLeastBeside = 1e-3;   ///< of a hypothesis beside which others are weighed
constexpr int kWalkTerms = 40;

/// v less its mean.
VectorXd about_mean(const VectorXd& v) { return v.array() - v.mean(); }

/// Time about its mean, from the first dwell to the last 1.
VectorXd normalised_time(const VectorXd& time_h) {
    const double span = time_h[time_h.size() - 1] - time_h[0];
    return span > 0 ? VectorXd(about_mean(time_h) / span) : VectorXd::Zero(time_h.size());
}

VectorXd step_after(Index n, int dwells) {
    VectorXd z = VectorXd::Zero(n);
    z.tail(n - dwells).setOnes();
    return about_mean(z);
}

/// What the covariances of all hypotheses are made of.
struct Kernels {
    explicit Kernels(const GyroRates& gyro)
        : s0(unit_of(gyro.variance)), time(normalised_time(gyro.time_h)) {
        const Index n = gyro.dwells();
        const double span = gyro.time_h[n - 1] - gyro.time_h[0];
        elapsed =
            span > 0 ? VectorXd((gyro.time_h.array() - gyro.time_h[0]) / span) : VectorXd::Zero(n);
        walk_mean = walk_means(elapsed);
    }

    /// Columns that the bias, or with `unbalance` the mass unbalance, moves along, each of unit
    /// prior variance.
    [[nodiscard]] MatrixXd columns(const GyroRates& gyro, const DriftHypothesis& what) const {
        const Index n = gyro.dwells();
        std::vector<VectorXd> list;
        if (what.trend > 0) list.emplace_back(s0 * what.trend * time);
        if (what.unbalance != Unbalance::none) {
            const VectorXd g =
                what.unbalance == Unbalance::trend ? time : step_after(n, what.step_after);
            for (Index q = kFirstLinear; q < kFirstLinear + 3; ++q)
                list.emplace_back(s0 * kUnbalanceSize * g.cwiseProduct(gyro.regressors.col(q)));
        } else if (what.step_after > 0) {
            list.emplace_back(s0 * kStepSize * step_after(n, what.step_after));
        }
        MatrixXd out(n, static_cast<Index>(list.size()));
        for (std::size_t c = 0; c < list.size(); ++c) out.col(static_cast<Index>(c)) = list[c];
        return out;
    }

    /// Covariance of the bias at the last dwell with that at each.
    [[nodiscard]] VectorXd with_last(const GyroRates& gyro, const DriftHypothesis& what) const {
        const Index last = gyro.dwells() - 1;
        if (what.unbalance != Unbalance::none) return VectorXd::Zero(last + 1);
        const MatrixXd more = columns(gyro, what);
        return more * more.row(last).transpose() +
               VectorXd(s0 * s0 * what.walk * what.walk * (elapsed - walk_mean).array() +
                        s0 * s0 * what.walk * what.walk * (walk_mean.mean() - walk_mean[last]));
    }

    double s0;
    VectorXd time, elapsed;  ///< from the first dwell to the last 1: about the mean, from the first
    VectorXd walk_mean;
};

/// What all hypotheses of one scatter and one walk have in common: most of the work.
struct Common {
    Common(const GyroRates& gyro, const Kernels& kernels, double scatter, double walk_size)
        : walk(kernels.s0 * kernels.s0 * walk_size * walk_size),
          rates(gyro.variance.array() + kernels.s0 * kernels.s0 * scatter * scatter,
                kernels.elapsed, walk) {
        MatrixXd columns(gyro.dwells(), gyro.regressors.cols() + 1);
        columns << gyro.regressors, gyro.rate;
        data = rates.whiten(columns);
    }
    double walk;
    RatesCovariance rates;           ///< nothing added yet
    RatesCovariance::Whitened data;  ///< regressors, and the rates behind them
};

/// Generalised least squares with a prior.
struct Fit {
    Fit(const GyroRates& gyro, const Kernels& kernels, const Common& common,
        const MatrixXd& columns)
        : rates(drifting(common.rates, kernels.elapsed, common.walk, columns)),
          square(rates.square(common.data)),
          normal(normal_matrix(gyro, square)) {
        const Index terms = gyro.regressors.cols();
        const VectorXd right = square.col(terms).head(terms);
        value = normal.solve(right);
        log_likelihood = -0.5 * (rates.log_determinant() + normal.log_det() + square(terms, terms) -
                                 right.dot(value));
    }
    [[nodiscard]] MatrixXd gain(const GyroRates& gyro) const {
        return normal.solve(rates.solve(gyro.regressors).transpose());
    }
    /// Estimate and variance of the amplitude of a column that the covariance holds with a prior
    /// variance.
    [[nodiscard]] std::pair<double, double> amplitude(const GyroRates& gyro, const VectorXd& z,
                                                      double prior) const {
        const VectorXd of_z = rates.solve(z);
        const VectorXd left =
            of_z - rates.solve(gyro.regressors *
                               normal.solve(VectorXd(gyro.regressors.transpose() * of_z)));
        return {prior * left.dot(gyro.rate), prior - prior * prior * left.dot(z)};
    }

    RatesCovariance rates;
    MatrixXd square;  ///< of regressors and rates
    linear_algebra::Cholesky normal;
    VectorXd value;
    double log_likelihood = 0;

  private:
    [[nodiscard]] static linear_algebra::Cholesky normal_matrix(const GyroRates& gyro,
                                                                const MatrixXd& square) {
        const Index terms = gyro.regressors.cols();
        MatrixXd information = square.topLeftCorner(terms, terms);
        information.diagonal() += gyro.prior_information;
        return linear_algebra::Cholesky::or_nan(information);
    }
};

/// Fits of hypotheses, each with what it has in common with others.
class Fits {
  public:
    explicit Fits(const GyroRates& gyro) : kernels(gyro), gyro_(gyro) {}
    [[nodiscard]] Fit of(const DriftHypothesis& what) {
        auto& common = common_[{what.scatter, what.walk}];
        if (!common) common.emplace(gyro_, kernels, what.scatter, what.walk);
        return Fit(gyro_, kernels, *common, kernels.columns(gyro_, what));
    }
    const Kernels kernels;

  private:
    const GyroRates& gyro_;
    std::map<std::pair<double, double>, std::optional<Common>> common_;
};

void add_to(DriftWeights& sum, const DriftHypothesis& what, double w) {
    const bool step = what.step_after > 0 && what.unbalance == Unbalance::none;
    const bool unbalance = what.unbalance != Unbalance::none;
    if (what.scatter > 0) sum.scatter += w;
    if (what.walk > 0) sum.walk += w;
    if (what.trend > 0) sum.trend += w;
    if (step) sum.step += w;
    if (unbalance) sum.unbalance += w;
    if (what.scatter == 0 && what.walk == 0 && what.trend == 0 && !step && !unbalance)
        sum.none += w;
}

/// The bias of a hypothesis at the last dwell, given what it says of the rates.
std::pair<double, double> bias_now(const GyroRates& gyro, const Kernels& kernels,
                                   const DriftHypothesis& what, const Fit& fit) {
    const VectorXd last = kernels.with_last(gyro, what);
    const VectorXd of_last = fit.rates.solve(last);
    const double moved = of_last.dot(gyro.rate - gyro.regressors * fit.value);
    // d(value[0] + moved) / d rates, and what the kernel leaves.
    const VectorXd row =
        VectorXd::Unit(fit.value.size(), 0) - gyro.regressors.transpose() * of_last;
    const double variance =
        last[gyro.dwells() - 1] - last.dot(of_last) + fit.normal.whiten(row).squaredNorm();
    return {fit.value[0] + moved, std::max(0.0, variance)};
}

double trend_of(const GyroRates& gyro, const Kernels& kernels, const DriftHypothesis& what,
                const Fit& fit) {
    if (!(what.trend > 0)) return 0;
    const double size = kernels.s0 * what.trend;
    const double span_h = gyro.time_h[gyro.dwells() - 1] - gyro.time_h[0];
    return fit.amplitude(gyro, kernels.time, size * size).first / span_h;
}

/// Weights of the hypotheses after the rates, their sum 1, and the logarithm of what it was.
std::pair<std::vector<double>, double> weigh(Fits& fits,
                                             const std::vector<WeightedHypothesis>& list) {
    std::vector<double> weights;
    for (const WeightedHypothesis& one : list)
        weights.push_back(fits.of(one.what).log_likelihood + std::log(one.weight));
    const double largest = *std::max_element(weights.begin(), weights.end());
    double sum = 0;
    for (double& w : weights) sum += w = std::exp(w - largest);
    for (double& w : weights) w /= sum;
    return {std::move(weights), largest + std::log(sum)};
}

bool is_step(const DriftHypothesis& what) {
    return what.step_after > 0 && what.unbalance == Unbalance::none;
}

/// The likeliest place of a step, with its size by the likeliest hypothesis there.
DriftStep find_step(const GyroRates& gyro, Fits& fits, const std::vector<WeightedHypothesis>& list,
                    const std::vector<double>& weights) {
    std::vector<double> at(static_cast<std::size_t>(gyro.dwells()), 0.0);
    for (std::size_t i = 0; i < list.size(); ++i) {
        if (is_step(list[i].what))
            at[static_cast<std::size_t>(list[i].what.step_after)] += weights[i];
    }
    const auto place = std::max_element(at.begin(), at.end());
    DriftStep step;
    if (!(*place > 0)) return step;
    step.after_dwell = static_cast<int>(place - at.begin());
    step.weight = *place;
    const DriftHypothesis* best = nullptr;
    double best_weight = -1;
    for (std::size_t i = 0; i < list.size(); ++i) {
        if (!is_step(list[i].what) || list[i].what.step_after != step.after_dwell ||
            weights[i] <= best_weight)
            continue;
        best = &list[i].what;
        best_weight = weights[i];
    }
    const double prior = kStepSize * kStepSize * fits.kernels.s0 * fits.kernels.s0;
    const auto [size, variance] =
        fits.of(*best).amplitude(gyro, step_after(gyro.dwells(), step.after_dwell), prior);
    step.size = size;
    step.sigma = std::sqrt(std::max(0.0, variance));
    return step;
}

double log_likelihood(const GyroRates& gyro, double scatter, double walk) {
    const Kernels kernels(gyro);
    const MatrixXd declared = gyro.declared.rows() > 0 ? gyro.declared : MatrixXd(gyro.dwells(), 0);
    return Fit(gyro, kernels, Common(gyro, kernels, scatter, walk), declared).log_likelihood;
}

}  // namespace

double unit_of(const VectorXd& variance) { return std::sqrt(1 / variance.cwiseInverse().mean()); }

DriftAverage average_drift(const GyroRates& gyro, const Drift& drift) {
    Fits fits(gyro);
    const Kernels& kernels = fits.kernels;
    const std::vector<WeightedHypothesis> list = drift_hypotheses(gyro, drift, kernels.s0);
    const auto [weights, log_evidence] = weigh(fits, list);
    DriftAverage out;
    out.log_evidence = log_evidence;
    const Index terms = gyro.regressors.cols();
    out.value = VectorXd::Zero(terms);
    out.covariance = MatrixXd::Zero(terms, terms);
    out.gain = MatrixXd::Zero(terms, gyro.dwells());
    out.weights = {0};
    double now_square = 0;
    std::vector<std::pair<double, VectorXd>> values;
    for (std::size_t i = 0; i < list.size(); ++i) {
        const double w = weights[i];
        add_to(out.weights, list[i].what, w);
        if (w < kLeastWeight) continue;
        const Fit fit = fits.of(list[i].what);
        out.value += w * fit.value;
        out.covariance += w * fit.normal.inverse();
        out.gain += w * fit.gain(gyro);
        values.emplace_back(w, fit.value);
        const auto [now, variance] = bias_now(gyro, kernels, list[i].what, fit);
        out.bias_now += w * now;
        now_square += w * (variance + now * now);
        out.trend_deg_h_h += w * trend_of(gyro, kernels, list[i].what, fit);
        out.likeliest.emplace_back(list[i].what, w);
    }
    for (const auto& [w, value] : values) {
        const VectorXd off = value - out.value;
        out.covariance += w * off * off.transpose();
    }
    out.bias_now_sigma = std::sqrt(std::max(0.0, now_square - out.bias_now * out.bias_now));
    std::stable_sort(out.likeliest.begin(), out.likeliest.end(),
                     [](const auto& a, const auto& b) { return a.second > b.second; });
    out.step = find_step(gyro, fits, list, weights);
    return out;
}

MatrixXd mean_covariance(const GyroRates& gyro, const DriftAverage& average) {
    const Kernels kernels(gyro);
    const double unit = kernels.s0 * kernels.s0;
    double scatter = 0, walk = 0;
    MatrixXd out = gyro.variance.asDiagonal();
    for (const auto& [what, weight] : average.likeliest) {
        scatter += weight * what.scatter * what.scatter;
        walk += weight * what.walk * what.walk;
        const MatrixXd columns = kernels.columns(gyro, what);
        if (columns.cols() > 0) out += weight * columns * columns.transpose();
    }
    const VectorXd& mean = kernels.walk_mean;
    for (Index i = 0; i < out.rows(); ++i) {
        out(i, i) += unit * scatter;
        for (Index k = 0; k < out.cols(); ++k)
            out(i, k) += unit * walk *
                         (std::min(kernels.elapsed[i], kernels.elapsed[k]) - mean[i] - mean[k] +
                          mean.mean());
    }
    return out;
}

DriftColumns drift_columns(const GyroRates& gyro, const DriftAverage& average) {
    const Kernels kernels(gyro);
    DriftColumns out;
    double walk = 0;
    std::vector<VectorXd> list;
    for (const auto& [what, weight] : average.likeliest) {
        if (weight < kLeastBeside) continue;
        out.scatter += weight * kernels.s0 * kernels.s0 * what.scatter * what.scatter;
        walk += weight * kernels.s0 * kernels.s0 * what.walk * what.walk;
        const MatrixXd columns = kernels.columns(gyro, what);
        for (Index c = 0; c < columns.cols(); ++c)
            list.emplace_back(std::sqrt(weight) * columns.col(c));
    }
    // A walk by its series (Karhunen and Loeve): what 40 terms leave is 1/(40 pi^2) of it.
    for (int k = 0; walk > 0 && k < std::min<Index>(kWalkTerms, gyro.dwells()); ++k) {
        const double turns = (k + 0.5) * std::numbers::pi;
        list.emplace_back(std::sqrt(2 * walk) / turns * (turns * kernels.elapsed).array().sin());
    }
    out.columns.resize(gyro.dwells(), static_cast<Index>(list.size()));
    for (std::size_t c = 0; c < list.size(); ++c) out.columns.col(static_cast<Index>(c)) = list[c];
    return out;
}

DriftLikelihood::DriftLikelihood(const GyroRates& gyro)
    : gyro_(gyro), none_(log_likelihood(gyro, 0, 0)) {}

double DriftLikelihood::ratio_of_scatter(double size) const {
    return log_likelihood(gyro_, size, 0) - none_;
}

double DriftLikelihood::ratio_of_walk(double size) const {
    return log_likelihood(gyro_, 0, size) - none_;
}

}  // namespace vibrig::estimator::uncertainty
