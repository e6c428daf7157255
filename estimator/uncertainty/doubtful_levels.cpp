#include "estimator/uncertainty/doubtful_levels.hpp"

#include <algorithm>

#include "estimator/filter/mapped.hpp"
#include "estimator/level/vibration_level.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

/// A harmonic of 5 % of the fundamental, which is usual, moves the amplitude by 5 % times the
/// cosine of its phase: this is its standard deviation.
constexpr double kAmplitude = 0.05 / 1.41421356;
constexpr double kStep = 1e-4;

/// Of the dwell that has lost least.
double period_of(const DwellTable& table) {
    double period_s = HUGE_VAL;
    for (const DwellRow& row : table.rows)
        if (row.used > 0) period_s = std::min(period_s, row.duration_s / row.used);
    return period_s;
}

}  // namespace

std::vector<DwellRow> with_doubtful_levels(const Settings& settings, const DwellTable& table,
                                           const ForwardModel& model) {
    std::vector<DwellRow> rows;
    const double period_s = period_of(table);
    Disturbance more, less;
    more.accelerometer_gain = kStep;
    less.accelerometer_gain = -kStep;
    for (std::size_t k = 0; k < table.rows.size(); ++k) {
        const DwellRow& row = table.rows[k];
        if (!row.flagged || !(row.frequency_hz > 0) ||
            *VibrationLevel::aliasing(row.frequency_hz, period_s, settings.level_window_s) == '\0')
            continue;
        if (rows.empty()) rows.assign(table.rows.begin(), table.rows.end());
        const Eigen::Vector3d moved =
            kAmplitude / (2 * kStep) * (model.apparent(row, more) - model.apparent(row, less));
        mapped(rows[k].variance) += moved * moved.transpose();
    }
    return rows;
}

}  // namespace vibrig::estimator::uncertainty
