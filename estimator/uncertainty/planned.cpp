#include "estimator/uncertainty/planned.hpp"

#include "estimator/filter/angles.hpp"
#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/second_moment.hpp"
#include "estimator/identification/crlb.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

/// Ramps within a dwell are known so much worse than its mean rate: 0.0322 to 0.00699 deg/h in
/// 100 s, whatever the noise is.
constexpr double kRampOverRate = 0.0322 / 0.00699;

}  // namespace

Result planned_result(const Settings& settings, const std::vector<PlannedStop>& stops,
                      const std::array<double, kParameters>& nominal, double period_s) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    ParameterArray truth{};
    for (std::size_t i = 0; i < kParameters; ++i) truth[internal_of(i)] = nominal[i];
    Result result;
    result.observable.fill(true);
    result.cross_check.done = true;
    for (const PlannedStop& stop : stops) {
        DwellRow row;
        row.run = stop.run;
        row.position = stop.position;
        row.vibration.kappa = 1 + stop.amplitude_g * stop.amplitude_g / 2;
        row.frequency_hz = stop.amplitude_g > 0 ? settings.frequency_hz : 0;
        row.duration_s = stop.duration_s;
        row.middle_s = stop.begin_s + stop.duration_s / 2;
        row.common_clock = true;
        row.nis_per_dof = 1;
        row.used = static_cast<std::uint32_t>(stop.duration_s / period_s);
        for (std::size_t k = 0; k < 3; ++k) row.angles[k] = stop.angles_deg[k] * kRadPerDeg;
        const Pose pose = kinematics.pose(mapped(row.angles));
        const Regressors h = model.regressors(pose.up, second_moment(pose, row.vibration));
        for (std::size_t j = 0; j < kGyros; ++j) {
            for (std::size_t g = 0; g < kGroups; ++g) {
                row.regressors[j][g] = h[g][j];
                row.rate[j] += h[g][j] * truth[internal_index(g, j)];
            }
        }
        const double variance = rate_variance(settings, stop.duration_s, period_s);
        for (std::size_t j = 0; j < kGyros; ++j) {
            row.variance[j][j] = variance;
            row.ramp_variance[j][j] = kRampOverRate * kRampOverRate * variance;
        }
        DwellSummary dwell;
        dwell.run = row.run;
        dwell.position = row.position;
        dwell.samples = dwell.used = row.used;
        dwell.nis_per_dof = 1;
        result.dwells.push_back(dwell);
        result.rows.push_back(row);
    }
    return result;
}

}  // namespace vibrig::estimator::uncertainty
