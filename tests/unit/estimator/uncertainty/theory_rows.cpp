#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

#include <cmath>
#include <sstream>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/second_moment.hpp"
#include "estimator/identification/dwell_row.hpp"
#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr double kDwell_s = 100, kPeriod_s = 160;

/// "9L 11l": position, L for the first level, l for the second.
std::vector<PlannedRow> parse(const char* order, double first_g, double second_g) {
    std::vector<PlannedRow> plan;
    std::istringstream in(order);
    int position = 0;
    char level = 0;
    while (in >> position >> level)
        plan.push_back({position, level == 'L' ? 1 : 2, level == 'L' ? first_g : second_g});
    return plan;
}

}  // namespace

std::vector<PlannedRow> balanced(double first_g, double second_g) {
    return parse(
        "9L 11l 5L 3l 7l 14L 12l 13L 6l 2L 3L 4l 1L 2l 10L 9l 12L 1l 14l 7L 8L 5l 6L 8l 4L 13l 11L "
        "10l",
        first_g, second_g);
}

std::vector<PlannedRow> balanced_with_rest(double first_g) {
    return parse(
        "9l 11L 11l 3l 3L 2L 6l 4L 12l 8L 8l 6L 13L 13l 14L 7L 4l 1L 2l 5L 5l 10l 10L 9L 14l 12L "
        "1l 7l",
        first_g, 0);
}

std::vector<PlannedRow> sequential(double first_g, double second_g) {
    std::vector<PlannedRow> plan;
    for (int p = 1; p <= 14; ++p) plan.push_back({p, 1, first_g});
    for (int p = 1; p <= 14; ++p) plan.push_back({p, 2, second_g});
    return plan;
}

std::vector<PlannedRow> pairs(double first_g, double second_g) {
    std::vector<PlannedRow> plan;
    for (int p = 1; p <= 14; ++p) {
        plan.push_back({p, 1, first_g});
        plan.push_back({p, 2, second_g});
    }
    return plan;
}

std::vector<DwellRow> theory_rows(const Settings& settings, const std::vector<PlannedRow>& plan) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    ParameterArray truth{};
    for (std::size_t i = 0; i < kParameters; ++i) truth[internal_of(i)] = kTable2[i];
    std::vector<DwellRow> rows;
    for (const PlannedRow& planned : plan) {
        DwellRow row;
        row.run = planned.run;
        row.position = planned.position;
        row.vibration.kappa = 1 + planned.amplitude_g * planned.amplitude_g / 2;
        row.frequency_hz = planned.amplitude_g > 0 ? 15 : 0;
        row.duration_s = kDwell_s;
        row.middle_s = kPeriod_s * static_cast<double>(rows.size()) + kDwell_s / 2;
        row.common_clock = true;
        row.nis_per_dof = 1;
        row.used = 3999;
        const auto& deg = kTable1[static_cast<std::size_t>(planned.position - 1)];
        const Eigen::Vector3d start = Eigen::Vector3d(deg[0], deg[1], deg[2]) * kRad;
        const auto regressors = [&](const Pose& pose) {
            return model.regressors(pose.up, second_moment(pose, row.vibration));
        };
        const Pose at_start = kinematics.pose(start);
        const Eigen::Vector3d rate =
            at_start.m * model.platform_rate(at_start, regressors(at_start), truth.data());
        mapped(row.angles) = start + rate * (kDwell_s / 2 / kArcsecPerRad);
        const Regressors h = regressors(kinematics.pose(mapped(row.angles)));
        for (std::size_t j = 0; j < kGyros; ++j) {
            for (std::size_t g = 0; g < kGroups; ++g) {
                row.regressors[j][g] = h[g][j];
                row.rate[j] += h[g][j] * truth[internal_index(g, j)];
            }
        }
        mapped(row.variance) = kRateVariance * Eigen::Matrix3d::Identity();
        mapped(row.ramp_variance) = kRampVariance * Eigen::Matrix3d::Identity();
        rows.push_back(row);
    }
    return rows;
}

void add_noise(std::vector<DwellRow>& rows, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    for (DwellRow& row : rows) {
        for (std::size_t j = 0; j < 3; ++j) {
            row.rate[j] += std::sqrt(row.variance[j][j]) * normal(random);
            row.ramp[j] += std::sqrt(row.ramp_variance[j][j]) * normal(random);
        }
    }
}

Result result_of(std::vector<DwellRow> rows) {
    Result result;
    result.observable.fill(true);
    result.cross_check.done = true;
    for (const DwellRow& row : rows) {
        DwellSummary dwell;
        dwell.run = row.run;
        dwell.position = row.position;
        dwell.samples = dwell.used = row.used;
        dwell.nis_per_dof = 1;
        result.dwells.push_back(dwell);
    }
    result.rows = std::move(rows);
    return result;
}

}  // namespace vibrig::estimator::testing
