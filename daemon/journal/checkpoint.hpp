#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/identification.hpp"

namespace vibrig::journal {

/// What the filter was fed in one finished dwell, and what it made of it. Fed again in order, the
/// filter comes to the same state to the last bit; the summary proves it.
struct DwellCheckpoint {
    estimator::DwellInfo info;
    estimator::DwellSummary summary;
    std::vector<estimator::Measurement> measurements;
};

inline constexpr std::uint32_t kCheckpointVersion = 1;

/// Of everything that the results depend on, "key = value" one per line.
[[nodiscard]] std::uint64_t configuration_hash(std::string_view text) noexcept;

/// With version, configuration hash and checksum.
[[nodiscard]] std::string encode(const DwellCheckpoint& dwell, std::uint64_t configuration_hash);
/// Empty: decoded. Else why not: corrupt, truncated, foreign, newer.
[[nodiscard]] std::string decode(std::string_view bytes, std::uint64_t configuration_hash,
                                 DwellCheckpoint& dwell);

/// Feeds the dwells to a fresh identification. Empty if every summary came out as it was to the
/// last bit; else which did not. Summaries get their reasons back.
[[nodiscard]] std::string replay(std::vector<DwellCheckpoint>& dwells,
                                 estimator::Identification& identification);

}  // namespace vibrig::journal
