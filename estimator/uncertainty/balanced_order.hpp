#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "estimator/plan/order.hpp"
#include "estimator/uncertainty/drift_states.hpp"

namespace vibrig::estimator::uncertainty {

/// Largest inflation of a coefficient's sigma when a step of the bias at one place is left free.
[[nodiscard]] double step_inflation(const GyroRates& gyro);

/// How well an order of dwells keeps slow changes of the bias apart from the coefficients.
struct OrderMerit {
    double bias = 1, largest = 1, median = 1;  ///< inflation of sigma by walk and trend
    double step = 1;                           ///< by one free step, worst place
    double slewing_s = 0;
    double cost = 0;  ///< what the search makes small
};
/// `visits` in the order of `order`; levels at the platform; `variance` of a dwell's rate,
/// (deg/h)^2. Planned are a walk of 0.03 deg/h/sqrt(h) and a trend of 0.1 deg/h/h.
[[nodiscard]] OrderMerit merit_of(const std::vector<plan::Visit>& visits, const plan::Order& order,
                                  const std::vector<plan::Row>& rows, const plan::Timing& timing,
                                  double variance);

/// The same for models of more coefficients: a row for each visit, the bias's column first.
[[nodiscard]] OrderMerit merit_of(const std::vector<plan::Visit>& visits, const plan::Order& order,
                                  const Eigen::MatrixXd& rows, const plan::Timing& timing,
                                  double variance);

struct SearchSettings {
    int starts = 6, moves = 6000;
    std::uint64_t seed = 1;
};
/// An order in which no slow change of the bias looks like a coefficient: found by exchange, each
/// position at every level, far apart in time. Fewer than 12 visits stay as they are. The same for
/// the same input; long lists get fewer moves.
[[nodiscard]] plan::Order balanced_order(const std::vector<plan::Visit>& visits,
                                         const std::vector<plan::Row>& rows,
                                         const plan::Timing& timing, double variance,
                                         const SearchSettings& how = {});
[[nodiscard]] plan::Order balanced_order(const std::vector<plan::Visit>& visits,
                                         const Eigen::MatrixXd& rows, const plan::Timing& timing,
                                         double variance, const SearchSettings& how = {});

}  // namespace vibrig::estimator::uncertainty
