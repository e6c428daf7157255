#pragma once

#include <string>
#include <vector>

#include "daemon/archive/deliver.hpp"

namespace vibrig::archive {

/// One thing that is wrong.
struct Finding {
    std::string what;  ///< "missing", "damaged", "index differs", "not in the index", ...
    std::string campaign, text;
};

struct Verified {
    std::size_t campaigns = 0, files = 0;
    std::int64_t bytes = 0;
    std::vector<Finding> findings;
};

/// Every campaign of the index against its files and what they say of it, and every folder of the
/// archive against the index; with a rig's recordings, every campaign there that is over against
/// the archive, and the other way round. `quick`: files' lengths alone. Throws if archive or index
/// cannot be opened.
[[nodiscard]] Verified verify(const Place& place, const std::string& recordings,
                              const std::string& rig, bool quick, const Progress& progress);

}  // namespace vibrig::archive
