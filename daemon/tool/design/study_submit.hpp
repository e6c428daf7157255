#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/study/folder.hpp"

namespace vibrig::tool::studies {

struct SlurmJob {
    std::string id;
    std::uint64_t shards = 0;
};

/// An array of `shards` (0: about a minute each), requeued when a node dies. Throws StudyError with
/// what sbatch says.
[[nodiscard]] SlurmJob submit_to_slurm(const study::Folder& folder, std::uint64_t shards,
                                       const std::vector<std::string>& options);

}  // namespace vibrig::tool::studies
