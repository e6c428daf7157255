#include "tests/unit/estimator/spectrum/from_samples.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>

#include "estimator/identification/dwell_row.hpp"
#include "estimator/spectrum/profile.hpp"

namespace vibrig::estimator::spectrum::testing {

Measurement measurement_of(const plant::PlannedSample& sample) noexcept {
    Measurement measurement;
    measurement.time_s = sample.time_s;
    for (std::size_t i = 0; i < 3; ++i) {
        measurement.angle_rad[i] = sample.readings.encoder_deg[i] * std::numbers::pi / 180;
        measurement.force_g[i] = sample.readings.raw_g[i];
    }
    return measurement;
}

RandomVibration played_in(const plant::Truth& truth, const plant::CampaignPlan& plan,
                          std::size_t run, double stated) {
    const std::uint16_t number = plan.profile_of(run);
    for (const auto& played : truth.profiles) {
        if (played.number != number) continue;
        const Profile profile{"", played.psd, {}, {0, 1, 0}, 0};
        return {stated * mean_square(profile), bandwidth_hz(bands_of(profile)), 0.01,
                played.psd.back().first, number};
    }
    return {};
}

std::vector<DwellRow> rows_through(const plant::Truth& truth, const plant::CampaignPlan& plan,
                                   const Settings& settings) {
    std::optional<Identification> dwell;
    std::pair<std::size_t, std::size_t> now{0, 0};
    std::vector<DwellRow> rows;
    const auto close = [&] {
        if (!dwell) return;
        const DwellSummary summary = dwell->end_dwell();
        ASSERT_EQ(dwell->rows().size(), 1U) << summary.reason;
        rows.push_back(dwell->rows()[0]);
    };
    plant::simulate(truth, plan, [&](const plant::PlannedSample& sample) {
        if (now != std::pair{sample.run, sample.position}) {
            close();
            now = {sample.run, sample.position};
            dwell.emplace(settings, 1);
            DwellInfo info{static_cast<int>(sample.run), static_cast<int>(sample.position)};
            info.begin_s = 0;  // the times of the plan go on
            info.random = played_in(truth, plan, sample.run);
            if (plan.profile_of(sample.run) == 0) info.frequency_hz = plan.hz_of(sample.run);
            dwell->begin_dwell(info);
        }
        static_cast<void>(dwell->add(measurement_of(sample)));
    });
    close();
    return rows;
}

}  // namespace vibrig::estimator::spectrum::testing
