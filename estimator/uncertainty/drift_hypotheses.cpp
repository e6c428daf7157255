#include "estimator/uncertainty/drift_hypotheses.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Unbalance = DriftHypothesis::Unbalance;

constexpr double kNothing = 0.6;  ///< prior weight of a value of zero
constexpr std::size_t kMostPlaces = 40;
/// With fewer rates to spare the data cannot tell one hypothesis from another.
constexpr Index kFewestDwells = 12;

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

void add_slow(std::vector<WeightedHypothesis>& list) {
    static const std::vector<double> kScatterSizes{0, 1, 2, 4, 8, 16},
        kWalkSizes{0, 2, 4, 8, 16, 32}, kTrendSizes{0, 4, 16};
    for (const double a : kScatterSizes) {
        for (const double b : kWalkSizes) {
            for (const double c : kTrendSizes) {
                list.push_back({{a, b, c},
                                0.85 * share(a, kScatterSizes) * share(b, kWalkSizes) *
                                    share(c, kTrendSizes)});
            }
        }
    }
}

void add_steps(std::vector<WeightedHypothesis>& list, Index n,
               const std::vector<std::size_t>& breaks) {
    constexpr std::array<std::pair<double, double>, 3> kWalks{{{0, 0.6}, {4, 0.2}, {16, 0.2}}};
    const std::vector<int> at = places(2, n - 2);
    for (const int k : at) {
        if (std::find(breaks.begin(), breaks.end(), static_cast<std::size_t>(k)) != breaks.end())
            continue;
        for (const auto& [walk, part] : kWalks)
            list.push_back({{0, walk, 0, k}, 0.1 / static_cast<double>(at.size()) * part});
    }
    for (const std::size_t k : breaks) {
        if (k < 1 || static_cast<Index>(k) >= n) continue;
        for (const auto& [walk, part] : kWalks)
            list.push_back({{0, walk, 0, static_cast<int>(k)}, 0.5 * part});
    }
}

void add_unbalance(std::vector<WeightedHypothesis>& list, Index n) {
    for (const double walk : {0.0, 4.0}) list.push_back({{0, walk, 0, 0, Unbalance::trend}, 0.01});
    const std::vector<int> at = places(3, n - 3);
    for (const int k : at)
        list.push_back({{0, 0, 0, k, Unbalance::step}, 0.03 / static_cast<double>(at.size())});
}

}  // namespace

std::vector<WeightedHypothesis> drift_hypotheses(const GyroRates& gyro, const Drift& drift,
                                                 double s0) {
    const Index n = gyro.dwells();
    const double span_h = gyro.time_h[n - 1] - gyro.time_h[0];
    std::vector<WeightedHypothesis> list;
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

}  // namespace vibrig::estimator::uncertainty
