#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/domain/positions.hpp"
#include "drivers/base/clock.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::dwells {
class DwellBook;
}

namespace vibrig::journal {

/// What the filter was fed in one finished dwell, and what it made of it. Fed again in order, the
/// filter and the noise monitor come to the same state to the last bit; the summary proves it.
struct DwellCheckpoint {
    estimator::DwellInfo info;
    estimator::DwellSummary summary;
    std::vector<estimator::Measurement> measurements;
    StopDone stop;
    bool noise_known = true;  ///< false: of version 1, which did not keep the noise levels
    bool stop_known = true;   ///< false: of version 2 or older
    bool time_known = true;   ///< false: of version 3 or older
};

inline constexpr std::uint32_t kCheckpointVersion = 9;

/// Hash of everything that the results depend on, "key = value" one per line.
[[nodiscard]] std::uint64_t configuration_hash(std::string_view text) noexcept;

/// With version, configuration hash and checksum.
[[nodiscard]] std::string encode(const DwellCheckpoint& dwell, std::uint64_t configuration_hash);
/// Empty: decoded. Else why not: corrupt, truncated, foreign, newer.
[[nodiscard]] std::string decode(std::string_view bytes, std::uint64_t configuration_hash,
                                 DwellCheckpoint& dwell);

/// Enters the dwells, which were ordered with this length, in a fresh book. Empty if every summary
/// came out as it was to the last bit, filtered with the noise levels it was; else which did not.
/// Summaries get their reasons back.
[[nodiscard]] std::string replay(std::vector<DwellCheckpoint>& dwells, dwells::DwellBook& book,
                                 drivers::Time dwell_length);

}  // namespace vibrig::journal
