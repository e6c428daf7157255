#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>

#include "estimator/identification/result.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::testing {

inline constexpr std::uint64_t kCrossSeed = 60;

inline bool reported(const Result& result, const std::string& words) {
    return std::any_of(result.warnings.begin(), result.warnings.end(),
                       [&](const std::string& text) { return text.find(words) != text.npos; });
}

inline Result identified(const Settings& settings, std::array<double, 2> levels_g,
                         const decltype(RigSimulator::spoil)& spoil = {}) {
    Identification identification(settings);
    RigSimulator rig(kCrossSeed);
    rig.spoil = spoil;
    SimulatedDwell plan;
    plan.duration_s = 20;
    plan.lost_probability = 0.01;
    plan.spike_probability = 0.001;
    rig.campaign(identification, levels_g, plan);
    // The inner gimbal leans: gyro noise is not isotropic in the gimbal angles then.
    plan.info = {2, 15, -1};
    plan.amplitude_g = levels_g[1];
    plan.angles_deg = {20, 40, -30};
    rig.dwell(identification, plan);
    return identification.result();
}

}  // namespace vibrig::estimator::testing
