#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "estimator/uncertainty/forward_model.hpp"

namespace vibrig::estimator::uncertainty {

/// Dwells of a campaign as the fit takes them. Rates of row k and gyro j: element 3 k + j.
struct DwellTable {
    std::span<const DwellRow> rows;
    Eigen::VectorXd time_h;  ///< middle of the dwells since that of the first
    bool times_assumed = false;

    [[nodiscard]] Eigen::Index dwells() const { return static_cast<Eigen::Index>(rows.size()); }
};

/// `rows` must outlive the table. Without a clock common to all dwells each follows the one before
/// after a minute.
[[nodiscard]] DwellTable dwell_table(std::span<const DwellRow> rows);

/// Rates that one unknown of a class moves, 3 n, for the size of the class.
struct Signatures {
    Eigen::MatrixXd z;  ///< 3 n x unknowns
    double size = 1;    ///< of the unknowns, in `unit`
    const char* unit = "";
    std::vector<std::string> elements;
    /// Each unknown, in sizes, as a disturbance of the forward model; empty: a drift, which is
    /// linear.
    std::vector<std::function<void(Disturbance&, double)>> sets;
};

/// By central differences of the forward model, for one unit of an input.
[[nodiscard]] Eigen::VectorXd signature(const DwellTable& table, const ForwardModel& model,
                                        const std::function<void(Disturbance&, double)>& set,
                                        double step);

/// `after_dwell`: place of a step; `s0`: unit of a drift's sizes, unit_of().
[[nodiscard]] Signatures signatures(Misfit misfit, const DwellTable& table,
                                    const ForwardModel& model, double s0, int after_dwell = 0);

}  // namespace vibrig::estimator::uncertainty
