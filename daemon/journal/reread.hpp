#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "daemon/journal/checkpoint.hpp"

namespace vibrig::journal {

/// What the filter was fed in the campaign in progress, dwell by dwell in their order, from the
/// file that the journal's thread writes; waits until it has the `last` of them. Any thread. Empty:
/// all of them; else why not.
[[nodiscard]] std::string reread(const std::string& path, std::uint64_t configuration_hash,
                                 const estimator::DwellSummary& last,
                                 const std::function<void(const DwellCheckpoint&)>& take);

}  // namespace vibrig::journal
