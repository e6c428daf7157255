#pragma once

#include <array>
#include <cstdint>
#include <numbers>
#include <vector>

#include "daemon/plan/forecast.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/plan/order.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::plan {

inline constexpr double kDwell = 100, kPeriod_s = 0.025;

/// The simulated rig, one dwell at a time, each with noise of its own.
class SimulatedRig {
  public:
    explicit SimulatedRig(std::uint64_t seed) { truth_.seed = 1000 * seed; }

    void dwell(estimator::Identification& to, const PlannedRun& run) {
        plant::CampaignPlan plan;
        plan.positions_deg = {run.position_deg};
        plan.table_g = {run.table_g};
        plan.dwell_s = kDwell;
        ++truth_.seed;
        ++dwells_;
        to.begin_dwell({1, dwells_, run.table_g});
        static_cast<void>(plant::simulate(truth_, plan, [&](const plant::PlannedSample& s) {
            estimator::Measurement m;
            m.time_s = s.time_s;
            for (std::size_t k = 0; k < 3; ++k) {
                m.angle_rad[k] = s.readings.encoder_deg[k] * std::numbers::pi / 180;
                m.force_g[k] = s.readings.raw_g[k];
            }
            static_cast<void>(to.add(m));
        }));
        static_cast<void>(to.end_dwell());
        if (run.table_g > 0) shaker_s_ += kDwell + timing_.settle_s + 2 * timing_.ramp_s;
        rig_s_ += kDwell + timing_.settle_s + (run.table_g > 0 ? 2 * timing_.ramp_s : 0) +
                  planning::slew_s(here_, run.position_deg, timing_);
        here_ = run.position_deg;
    }

    [[nodiscard]] double shaker_s() const { return shaker_s_; }
    [[nodiscard]] double rig_s() const { return rig_s_; }
    [[nodiscard]] int dwells() const { return dwells_; }
    [[nodiscard]] const std::array<double, 3>& here() const { return here_; }
    [[nodiscard]] double truth(std::size_t i) const { return truth_.coefficients[i / 10][i % 10]; }

  private:
    plant::Truth truth_;
    planning::Timing timing_;
    std::array<double, 3> here_{};
    double shaker_s_ = 0, rig_s_ = 0;
    int dwells_ = 0;
};

inline std::vector<PlannedRun> fourteen_positions() {
    std::vector<PlannedRun> runs;
    for (const double table_g : {9.0, 7.0}) {
        for (const auto& position : plant::CampaignPlan::table1())
            runs.push_back({position, table_g * estimator::Settings{}.transmission, table_g, 1});
    }
    return runs;
}

}  // namespace vibrig::plan
