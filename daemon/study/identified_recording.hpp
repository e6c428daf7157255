#pragma once

#include <string>
#include <vector>

#include "daemon/record/replay.hpp"
#include "daemon/study/study.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::study {

/// What an identification with the study's settings gives.
struct IdentifiedRecording {
    std::string name, serial, state, old_result;
    estimator::Settings settings;
    record::ReplayResult replayed;
    estimator::uncertainty::Assessment assessed;
    bool simulated = false;  ///< the rig was a program
};
/// Throws StudyError if it is not what was planned, else what reading and replaying throw.
[[nodiscard]] IdentifiedRecording identify_recording(const Recording& recording,
                                                     const std::vector<Setting>& settings);

}  // namespace vibrig::study
