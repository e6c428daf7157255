#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "daemon/archive/entry.hpp"
#include "daemon/archive/index.hpp"

namespace vibrig::archive {

/// Whether one may be compared with the reference, by their at_hz: of the same vibration as
/// estimator::same_vibration() has it. What is of no single frequency depends on the share that
/// each had in its campaign, and is compared with none; what is not noted is of a vibration of its
/// own.
[[nodiscard]] bool same_vibration(const std::optional<double>& one,
                                  const std::optional<double>& reference);
/// Those that both determine.
[[nodiscard]] bool same_vibration(const Coefficients& one, const Coefficients& reference);
/// "at 15 Hz", "static", "at no single frequency", "of a vibration that is not noted".
[[nodiscard]] std::string vibration_text(const std::optional<double>& at_hz);
/// Each of them once, with commas between; empty: there is no quadratic coefficient.
[[nodiscard]] std::string vibrations_in(const Coefficients& of);
/// All quadratic ones at this frequency, 0: static; nothing: none is asked for.
[[nodiscard]] Coefficients all_at(const std::optional<double>& hz);
/// How many have quadratic coefficients of another vibration than this campaign.
[[nodiscard]] std::size_t count_of_other_vibrations(const Coefficients& of,
                                                    const std::vector<Entry>& campaigns);

[[nodiscard]] bool vibration_noted(const Coefficients& of);
/// What was noted before the index kept it is read from the recordings, where these are there, and
/// noted by whoever may write.
void read_vibrations(Index& index, const std::string& folder, std::vector<Entry>& campaigns);

}  // namespace vibrig::archive
