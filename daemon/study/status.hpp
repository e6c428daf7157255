#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/study/merge.hpp"

namespace vibrig::study {

/// A part that a process writes now, or wrote not long ago.
struct RunningPart {
    std::string file, host;
    Shard shard;
    long pid = 0;
    std::uint64_t records = 0;
    double age_s = 0;  ///< since the last write, by the file system's clock
    double per_s = 0;  ///< 0: not known
};

struct StudyStatus {
    std::uint64_t tasks = 0, done = 0, failed = 0, parts = 0;
    std::vector<RunningPart> running;
    MergeFindings found;  ///< damaged: what is torn and nobody writes any more, too
    double left_s = -1;   ///< at the rate of those that run; negative: not known
};

/// Reads all parts. `fresh_s`: who has written within it counts as running.
[[nodiscard]] StudyStatus status_of(const Folder& folder, double fresh_s = 60);

}  // namespace vibrig::study
