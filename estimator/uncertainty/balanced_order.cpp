#include "estimator/uncertainty/balanced_order.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/rates_covariance.hpp"

namespace vibrig::estimator::uncertainty {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kWalk = 0.03, kTrend = 0.1;  ///< deg/h/sqrt(h), deg/h/h
constexpr double kOfLargest = 0.3, kOfStep = 0.3, kOfSlewing = 2e-4;
constexpr double kHottest = 0.1, kColdest = 1e-4;
constexpr std::size_t kFewest = 12;
/// So many dwells get all moves; the work of a move grows with them.
constexpr double kForAllMoves = 28;
constexpr double kSecondsPerHour = 3600;

/// Against plans that do not determine a term: 10 deg/h, 10 deg/h/g, 1 deg/h/g^2.
VectorXd prior_information(Index columns) {
    VectorXd information = VectorXd::Ones(columns);
    information.head<4>().setConstant(0.01);
    return information;
}

MatrixXd matrix_of(const std::vector<plan::Row>& rows) {
    MatrixXd out(static_cast<Index>(rows.size()), static_cast<Index>(plan::kTerms));
    for (std::size_t i = 0; i < rows.size(); ++i) {
        for (std::size_t c = 0; c < plan::kTerms; ++c)
            out(static_cast<Index>(i), static_cast<Index>(c)) = rows[i][c];
    }
    return out;
}

GyroRates rates_of(const std::vector<plan::Visit>& visits, const plan::Order& order,
                   const MatrixXd& rows, const plan::Timing& timing, double variance) {
    const auto n = static_cast<Index>(order.size());
    GyroRates gyro;
    gyro.time_h.resize(n);
    gyro.rate = VectorXd::Zero(n);
    gyro.variance = VectorXd::Constant(n, variance);
    gyro.regressors.resize(n, rows.cols());
    gyro.prior_information = prior_information(rows.cols());
    plan::Vec3 here{};
    double now_s = 0;
    for (Index k = 0; k < n; ++k) {
        const std::size_t i = order[static_cast<std::size_t>(k)];
        const double ramp_s = visits[i].level_g > 0 ? timing.ramp_s : 0;
        now_s += plan::slew_s(here, visits[i].position_deg, timing) + ramp_s + timing.settle_s;
        gyro.time_h[k] = (now_s + timing.dwell_s / 2) / kSecondsPerHour;
        now_s += timing.dwell_s + ramp_s;
        here = visits[i].position_deg;
        gyro.regressors.row(k) = rows.row(static_cast<Index>(i));
    }
    return gyro;
}

VectorXd variances(const GyroRates& gyro, const RatesCovariance& rates) {
    MatrixXd information = rates.square(gyro.regressors);
    information.diagonal() += gyro.prior_information;
    return linear_algebra::positive_inverse(information).diagonal();
}

/// The last moves of a search are judged by chance alone: an own generator, the same everywhere.
class Dice {
  public:
    explicit Dice(std::uint64_t seed) : random_(seed) {}
    std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_() % n); }
    double one() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  private:
    std::mt19937_64 random_;
};

void move(plan::Order& order, Dice& dice) {
    const std::size_t i = dice.below(order.size()), j = dice.below(order.size());
    if (dice.below(2) == 0) {
        std::swap(order[i], order[j]);
        return;
    }
    const auto at = [&](std::size_t k) { return order.begin() + static_cast<std::ptrdiff_t>(k); };
    if (i < j) {
        std::rotate(at(i), at(i) + 1, at(j) + 1);
    } else {
        std::rotate(at(j), at(i), at(i) + 1);
    }
}

}  // namespace

double step_inflation(const GyroRates& gyro) {
    const Index n = gyro.dwells();
    const VectorXd weight = gyro.variance.cwiseInverse();
    MatrixXd information = gyro.regressors.transpose() * weight.asDiagonal() * gyro.regressors;
    const VectorXd all = gyro.regressors.transpose() * weight;
    information.diagonal() += gyro.prior_information;
    const Index columns = information.rows();
    const MatrixXd p = linear_algebra::positive_inverse(information);
    const double sum = weight.sum();
    double worst = 1, tail = 0;
    VectorXd of_tail = VectorXd::Zero(columns);
    for (Index k = n - 1; k >= 2; --k) {
        tail += weight[k];
        of_tail += weight[k] * gyro.regressors.row(k).transpose();
        if (k > n - 2) continue;
        // A step after dwell k is 1 from there on, less its mean.
        const double mean = static_cast<double>(n - k) / static_cast<double>(n);
        const VectorXd hz = of_tail - mean * all;
        const double zz = tail * (1 - 2 * mean) + mean * mean * sum;
        const VectorXd b = p * hz;
        const double left = std::max(zz - b.dot(hz), 1e-12 * zz);
        for (Index i = 0; i < columns; ++i)
            worst = std::max(worst, std::sqrt(1 + b[i] * b[i] / (left * p(i, i))));
    }
    return worst;
}

OrderMerit merit_of(const std::vector<plan::Visit>& visits, const plan::Order& order,
                    const MatrixXd& rows, const plan::Timing& timing, double variance) {
    const GyroRates gyro = rates_of(visits, order, rows, timing, variance);
    const VectorXd elapsed = gyro.time_h.array() - gyro.time_h[0];
    const VectorXd trend = kTrend * (gyro.time_h.array() - gyro.time_h.mean());
    const VectorXd still = variances(gyro, RatesCovariance(gyro.variance, elapsed, 0));
    const VectorXd moving = variances(gyro, drifting(gyro.variance, elapsed, kWalk * kWalk, trend));
    VectorXd f = (moving.array() / still.array()).sqrt();
    OrderMerit merit;
    merit.bias = f[0];
    merit.largest = f.maxCoeff();
    const double logs = f.array().log().mean();
    std::sort(f.begin(), f.end());
    merit.median = 0.5 * (f[(f.size() - 1) / 2] + f[f.size() / 2]);
    merit.step = step_inflation(gyro);
    merit.slewing_s = plan::duration(visits, order, timing).slewing_s;
    merit.cost = logs + kOfLargest * std::log(merit.largest) + kOfStep * std::log(merit.step) +
                 kOfSlewing * merit.slewing_s;
    return merit;
}

OrderMerit merit_of(const std::vector<plan::Visit>& visits, const plan::Order& order,
                    const std::vector<plan::Row>& rows, const plan::Timing& timing,
                    double variance) {
    return merit_of(visits, order, matrix_of(rows), timing, variance);
}

plan::Order balanced_order(const std::vector<plan::Visit>& visits,
                           const std::vector<plan::Row>& rows, const plan::Timing& timing,
                           double variance, const SearchSettings& how) {
    return balanced_order(visits, matrix_of(rows), timing, variance, how);
}

plan::Order balanced_order(const std::vector<plan::Visit>& visits, const MatrixXd& rows,
                           const plan::Timing& timing, double variance, const SearchSettings& how) {
    plan::Order best(visits.size());
    std::iota(best.begin(), best.end(), std::size_t{0});
    if (visits.size() < kFewest) return best;
    const plan::Order listed = best;
    const auto cost = [&](const plan::Order& order) {
        return merit_of(visits, order, rows, timing, variance).cost;
    };
    double least = cost(best);
    const double share = std::min(1.0, kForAllMoves / static_cast<double>(visits.size()));
    const int moves = std::max(100, static_cast<int>(how.moves * share * share));
    Dice dice(how.seed);
    for (int start = 0; start < how.starts; ++start) {
        plan::Order order = listed;
        for (std::size_t i = order.size() - 1; i > 0; --i)
            std::swap(order[i], order[dice.below(i + 1)]);
        double here = cost(order);
        for (int m = 0; m < moves; ++m) {
            const double heat =
                kHottest * std::pow(kColdest / kHottest, static_cast<double>(m) / moves);
            plan::Order other = order;
            move(other, dice);
            const double there = cost(other);
            if (there > here && dice.one() > std::exp((here - there) / heat)) continue;
            order = std::move(other);
            here = there;
            if (here >= least) continue;
            least = here;
            best = order;
        }
    }
    return best;
}

}  // namespace vibrig::estimator::uncertainty
