#include "estimator/uncertainty/drift_states.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Unbalance = DriftHypothesis::Unbalance;

constexpr double kStepSize = 12.0;      ///< prior size of a step, in s0
constexpr double kUnbalanceSize = 8.0;  ///< in s0 / g
constexpr double kNothing = 0.6;        ///< prior weight of a value of zero
constexpr std::size_t kMostPlaces = 40;
constexpr Index kFirstLinear = 1;  ///< of the three linear terms
/// With fewer rates to spare the data cannot tell one hypothesis from another.
constexpr Index kFewestDwells = 12;

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

struct Weighted {
    DriftHypothesis what;
    double weight;
};

double share(double size, const std::vector<double>& sizes) {
    if (size == 0) return kNothing;
    double sum = 0;
    for (const double other : sizes) sum += other > 0 ? 1 / (1 + other / 2) : 0;
    return (1 - kNothing) / (1 + size / 2) / sum;
}

/// Places from `first` to `last`, thinned if there are too many.
std::vector<int> places(Index first, Index last) {
    std::vector<int> all;
    if (last < first) return all;
    const auto count = static_cast<std::size_t>(last - first + 1);
    const std::size_t kept = count > 120 ? kMostPlaces : count;
    for (std::size_t i = 0; i < kept; ++i)
        all.push_back(static_cast<int>(first + static_cast<Index>(i * count / kept)));
    return all;
}

void add_slow(std::vector<Weighted>& list) {
    static const std::vector<double> kScatter{0, 1, 2, 4, 8, 16}, kWalk{0, 2, 4, 8, 16, 32},
        kTrend{0, 4, 16};
    for (const double a : kScatter) {
        for (const double b : kWalk) {
            for (const double c : kTrend) {
                list.push_back(
                    {{a, b, c}, 0.85 * share(a, kScatter) * share(b, kWalk) * share(c, kTrend)});
            }
        }
    }
}

void add_steps(std::vector<Weighted>& list, Index n, const std::vector<std::size_t>& breaks) {
    constexpr std::array<std::pair<double, double>, 3> kWalks{{{0, 0.6}, {4, 0.2}, {16, 0.2}}};
    const std::vector<int> at = places(2, n - 2);
    for (const int k : at) {
        for (const auto& [walk, part] : kWalks)
            list.push_back({{0, walk, 0, k}, 0.1 / static_cast<double>(at.size()) * part});
    }
    for (const std::size_t k : breaks) {
        if (k < 1 || static_cast<Index>(k) >= n) continue;
        for (const auto& [walk, part] : kWalks)
            list.push_back({{0, walk, 0, static_cast<int>(k)}, 0.5 * part});
    }
}

void add_unbalance(std::vector<Weighted>& list, Index n) {
    for (const double walk : {0.0, 4.0}) list.push_back({{0, walk, 0, 0, Unbalance::trend}, 0.01});
    const std::vector<int> at = places(3, n - 3);
    for (const int k : at)
        list.push_back({{0, 0, 0, k, Unbalance::step}, 0.03 / static_cast<double>(at.size())});
}

std::vector<Weighted> hypotheses(const GyroRates& gyro, const Drift& drift, double s0) {
    const Index n = gyro.dwells();
    const double span_h = gyro.time_h[n - 1] - gyro.time_h[0];
    std::vector<Weighted> list;
    if (drift.model == BiasModel::walk) {
        list.push_back({{0, drift.walk_deg_h_rt_h * std::sqrt(span_h) / s0, 0}, 1});
    } else if (drift.model == BiasModel::constant || n < kFewestDwells) {
        list.push_back({{}, 1});
    } else {
        add_slow(list);
        add_steps(list, n, gyro.breaks);
        add_unbalance(list, n);
    }
    return list;
}

/// What the kernels of all hypotheses are made of.
struct Kernels {
    explicit Kernels(const GyroRates& gyro)
        : s0(std::sqrt(gyro.variance.mean())),
          time(normalised_time(gyro.time_h)),
          walk(walk_kernel(gyro.time_h)) {}

    [[nodiscard]] MatrixXd covariance(const GyroRates& gyro, const DriftHypothesis& what) const {
        const Index n = gyro.dwells();
        const double unit = s0 * s0;
        MatrixXd cov = unit * what.walk * what.walk * walk;
        cov.diagonal() += gyro.variance;
        cov.diagonal().array() += unit * what.scatter * what.scatter;
        if (what.trend > 0) cov += unit * what.trend * what.trend * time * time.transpose();
        if (what.unbalance != Unbalance::none) {
            const VectorXd g =
                what.unbalance == Unbalance::trend ? time : step_after(n, what.step_after);
            for (Index q = kFirstLinear; q < kFirstLinear + 3; ++q) {
                const VectorXd gh = g.cwiseProduct(gyro.regressors.col(q));
                cov += unit * kUnbalanceSize * kUnbalanceSize * gh * gh.transpose();
            }
        } else if (what.step_after > 0) {
            const VectorXd z = step_after(n, what.step_after);
            cov += unit * kStepSize * kStepSize * z * z.transpose();
        }
        return cov;
    }

    double s0;
    VectorXd time;
    MatrixXd walk;
};

/// Generalised least squares with a prior.
struct Fit {
    Fit(const GyroRates& gyro, const MatrixXd& covariance) : factor(covariance) {
        MatrixXd white(gyro.dwells(), gyro.regressors.cols() + 1);
        white << gyro.regressors, gyro.rate;
        factor.matrixL().solveInPlace(white);
        const auto h = white.leftCols(gyro.regressors.cols());
        const auto y = white.rightCols<1>();
        information = h.transpose() * h;
        information.diagonal() += gyro.prior_information;
        const Eigen::LLT<MatrixXd> normal(information);
        const VectorXd right = h.transpose() * y;
        covariance_of = normal.solve(MatrixXd::Identity(information.rows(), information.cols()));
        value = covariance_of * right;
        whitened = h;
        log_likelihood = -factor.matrixL().toDenseMatrix().diagonal().array().log().sum() -
                         normal.matrixL().toDenseMatrix().diagonal().array().log().sum() -
                         0.5 * (y.squaredNorm() - right.dot(value));
    }
    [[nodiscard]] MatrixXd gain() const {
        const MatrixXd back = factor.matrixU().solve(whitened);
        return covariance_of * back.transpose();
    }
    /// Estimate and variance of the amplitude of a column that the covariance holds with a prior
    /// variance.
    [[nodiscard]] std::pair<double, double> amplitude(const GyroRates& gyro, const VectorXd& z,
                                                      double prior) const {
        const VectorXd of_z = factor.solve(z);
        const VectorXd left =
            of_z - factor.solve(MatrixXd(gyro.regressors *
                                         (covariance_of * (gyro.regressors.transpose() * of_z))));
        return {prior * left.dot(gyro.rate), prior - prior * prior * left.dot(z)};
    }

    Eigen::LLT<MatrixXd> factor;
    MatrixXd information, covariance_of, whitened;
    VectorXd value;
    double log_likelihood = 0;
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
    DriftHypothesis noise_free = what;
    noise_free.scatter = 0;
    MatrixXd kernel = kernels.covariance(gyro, noise_free);
    kernel.diagonal() -= gyro.variance;
    if (what.unbalance != Unbalance::none) kernel.setZero();
    const VectorXd last = kernel.col(gyro.dwells() - 1);
    const VectorXd of_last = fit.factor.solve(last);
    const double moved = of_last.dot(gyro.rate - gyro.regressors * fit.value);
    // d(value[0] + moved) / d rates, and what the kernel leaves.
    const VectorXd row =
        VectorXd::Unit(fit.value.size(), 0) - gyro.regressors.transpose() * of_last;
    const double variance =
        last[gyro.dwells() - 1] - last.dot(of_last) + row.dot(fit.covariance_of * row);
    return {fit.value[0] + moved, std::max(0.0, variance)};
}

}  // namespace

MatrixXd walk_kernel(const VectorXd& time_h) {
    const Index n = time_h.size();
    const double span = time_h[n - 1] - time_h[0];
    MatrixXd k = MatrixXd::Zero(n, n);
    if (!(span > 0)) return k;
    for (Index i = 0; i < n; ++i) {
        for (Index j = 0; j < n; ++j) k(i, j) = (std::min(time_h[i], time_h[j]) - time_h[0]) / span;
    }
    const VectorXd rows = k.rowwise().mean();
    const double all = rows.mean();
    k.colwise() -= rows;
    k.rowwise() -= rows.transpose();
    k.array() += all;
    return k;
}

DriftAverage average_drift(const GyroRates& gyro, const Drift& drift) {
    const Kernels kernels(gyro);
    const std::vector<Weighted> list = hypotheses(gyro, drift, kernels.s0);
    struct Told {
        VectorXd value;
        double now, now_variance;
    };
    std::vector<double> log_weight;
    std::vector<Fit> fits;
    fits.reserve(list.size());
    for (const Weighted& one : list) {
        fits.emplace_back(gyro, kernels.covariance(gyro, one.what));
        log_weight.push_back(fits.back().log_likelihood + std::log(one.weight));
    }
    const double largest = *std::max_element(log_weight.begin(), log_weight.end());
    double sum = 0;
    for (double& w : log_weight) sum += w = std::exp(w - largest);

    DriftAverage out;
    const Index terms = gyro.regressors.cols();
    out.value = VectorXd::Zero(terms);
    out.covariance = MatrixXd::Zero(terms, terms);
    out.gain = MatrixXd::Zero(terms, gyro.dwells());
    out.weights = {0};
    double now_square = 0;
    std::vector<double> of_step(static_cast<std::size_t>(gyro.dwells()), 0.0);
    for (std::size_t i = 0; i < list.size(); ++i) {
        const double w = log_weight[i] /= sum;
        add_to(out.weights, list[i].what, w);
        if (list[i].what.step_after > 0 && list[i].what.unbalance == Unbalance::none)
            of_step[static_cast<std::size_t>(list[i].what.step_after)] += w;
        if (w < 1e-12) continue;  // moves no digit
        out.value += w * fits[i].value;
        out.gain += w * fits[i].gain();
        const auto [now, variance] = bias_now(gyro, kernels, list[i].what, fits[i]);
        out.bias_now += w * now;
        now_square += w * (variance + now * now);
        out.likeliest.emplace_back(list[i].what, w);
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
        if (log_weight[i] < 1e-12) continue;
        const VectorXd off = fits[i].value - out.value;
        out.covariance += log_weight[i] * (fits[i].covariance_of + off * off.transpose());
    }
    out.bias_now_sigma = std::sqrt(std::max(0.0, now_square - out.bias_now * out.bias_now));
    std::sort(out.likeliest.begin(), out.likeliest.end(),
              [](const auto& a, const auto& b) { return a.second > b.second; });

    const auto place = std::max_element(of_step.begin(), of_step.end());
    if (place != of_step.end() && *place > 0) {
        out.step.after_dwell = static_cast<int>(place - of_step.begin());
        out.step.weight = *place;
        std::size_t best = 0;
        for (std::size_t i = 0; i < list.size(); ++i) {
            const DriftHypothesis& what = list[i].what;
            if (what.step_after != out.step.after_dwell || what.unbalance != Unbalance::none)
                continue;
            if (list[best].what.step_after != out.step.after_dwell ||
                log_weight[i] > log_weight[best])
                best = i;
        }
        const double prior = kStepSize * kStepSize * kernels.s0 * kernels.s0;
        const auto [size, variance] =
            fits[best].amplitude(gyro, step_after(gyro.dwells(), out.step.after_dwell), prior);
        out.step.size = size;
        out.step.sigma = std::sqrt(std::max(0.0, variance));
    }
    return out;
}

DriftLikelihood::DriftLikelihood(const GyroRates& gyro)
    : gyro_(gyro), walk_(walk_kernel(gyro.time_h)), s0_(std::sqrt(gyro.variance.mean())) {
    none_ = log_likelihood(0, 0);
}

double DriftLikelihood::log_likelihood(double scatter, double walk) const {
    MatrixXd cov = s0_ * s0_ * walk * walk * walk_;
    cov.diagonal() += gyro_.variance;
    cov.diagonal().array() += s0_ * s0_ * scatter * scatter;
    return Fit(gyro_, cov).log_likelihood;
}

double DriftLikelihood::ratio_of_scatter(double size) const {
    return log_likelihood(size, 0) - none_;
}

double DriftLikelihood::ratio_of_walk(double size) const { return log_likelihood(0, size) - none_; }

}  // namespace vibrig::estimator::uncertainty
