#include "tests/unit/estimator/uncertainty/from_samples.hpp"

#include <numbers>
#include <utility>

#include "tests/plant/recording.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::testing {
namespace {

std::string order_of(const std::vector<PlannedRow>& plan) {
    std::string out;
    for (const PlannedRow& row : plan)
        out +=
            (out.empty() ? "" : ",") + std::to_string(row.position) + "." + std::to_string(row.run);
    return out;
}

}  // namespace

Schedule balanced_schedule() { return {{9, 7}, order_of(balanced(6, 14.0 / 3))}; }
Schedule balanced_schedule_with_rest() { return {{9, 0}, order_of(balanced_with_rest(6))}; }
Schedule sequential_schedule() { return {{9, 7}, order_of(sequential(6, 14.0 / 3))}; }

plant::Truth quiet_rig() {
    plant::Truth truth;
    truth.resolver_arcsec = 0;
    truth.resolver_bits = 24;
    truth.gyro_random_walk_deg_per_rt_h = 0;
    truth.accelerometer_g = 0;
    return truth;
}

FromSamples from_samples(const Settings& settings, const plant::Truth& truth,
                         const Schedule& schedule) {
    plant::CampaignPlan plan;
    plan.order = plant::parse_order(schedule.order);
    plan.table_g = schedule.table_g;
    plan.frequency_hz = {settings.frequency_hz};
    Identification identification(settings);
    FromSamples out;
    std::size_t samples = 0;
    bool in_dwell = false;
    plant::simulate(
        truth, plan,
        [&](const plant::PlannedSample& sample) {
            if (!std::exchange(in_dwell, true))
                identification.begin_dwell({static_cast<int>(sample.run),
                                            static_cast<int>(sample.position),
                                            plan.table_g[sample.run - 1], 0});
            Measurement m;
            m.time_s = sample.time_s;
            for (std::size_t k = 0; k < 3; ++k) {
                m.angle_rad[k] = sample.readings.encoder_deg[k] * (std::numbers::pi / 180);
                m.force_g[k] = sample.readings.raw_g[k];
            }
            static_cast<void>(identification.add(m));
            ++samples;
            for (std::size_t j = 0; j < 3; ++j) {
                for (std::size_t t = 0; t < 10; ++t)
                    out.truth[10 * j + t] += sample.coefficients[j][t];
            }
        },
        [&](std::size_t, std::size_t) {
            static_cast<void>(identification.end_dwell());
            in_dwell = false;
        });
    for (double& one : out.truth) one /= static_cast<double>(samples);
    out.result = identification.result();
    return out;
}

}  // namespace vibrig::estimator::testing
