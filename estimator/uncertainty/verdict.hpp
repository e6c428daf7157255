#pragma once

#include <optional>
#include <string>

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::estimator::uncertainty {

/// Fewer than so many degrees of freedom test nothing.
inline constexpr int kFewestDegrees = 9;

/// What the rules say of an assessment that is complete but for its verdict.
[[nodiscard]] Verdict judge(const Settings& settings, const Result& result,
                            const Assessment& assessed, Stage stage);

/// Motion in step with the vibration, where it may matter beside u and nobody has said whose it is.
[[nodiscard]] std::optional<Reason> motion_in_step(const Settings& settings,
                                                   const Assessment& assessed);
/// Puts the reasons in order; level and sentence follow from them.
void conclude(const Assessment& assessed, Verdict& verdict);
/// Numbers of a rig that is not the configuration's are not valid, whatever their residuals.
/// `contradiction`: the first; empty changes nothing.
void contradict(Verdict& verdict, const std::string& contradiction);

}  // namespace vibrig::estimator::uncertainty
