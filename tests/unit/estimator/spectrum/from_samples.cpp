#include "tests/unit/estimator/spectrum/from_samples.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>

#include "estimator/spectrum/profile.hpp"

namespace vibrig::estimator::spectrum::testing {

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
            const int number = plan.profile_of(sample.run);
            if (number == 0) info.frequency_hz = plan.hz_of(sample.run);
            for (const auto& played : truth.profiles) {
                if (played.number != number) continue;
                const Profile profile{"", played.psd, {}, {0, 1, 0}, 0};
                info.random = {mean_square(profile), bandwidth_hz(bands_of(profile)), 0.01,
                               played.psd.back().first, static_cast<std::uint16_t>(number)};
            }
            dwell->begin_dwell(info);
        }
        Measurement m;
        m.time_s = sample.time_s;
        for (std::size_t i = 0; i < 3; ++i) {
            m.angle_rad[i] = sample.readings.encoder_deg[i] * std::numbers::pi / 180;
            m.force_g[i] = sample.readings.raw_g[i];
        }
        static_cast<void>(dwell->add(m));
    });
    close();
    return rows;
}

}  // namespace vibrig::estimator::spectrum::testing
