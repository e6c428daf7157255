#pragma once

#include <functional>
#include <string>
#include <vector>

#include "daemon/archive/entry.hpp"
#include "daemon/archive/index.hpp"

namespace vibrig::archive {

/// An archive: where campaigns' folders are, RIG/CAMPAIGN each, and the index of them.
struct Place {
    std::string folder;
    std::string index;  ///< a SQLite file or "postgresql://..."
};

struct Delivery {
    enum class Kind : std::uint8_t { copied, was_there, mended } kind = Kind::copied;
    Entry entry;             ///< as the index has it now
    std::string folder;      ///< in the archive
    bool elsewhere = false;  ///< it was there under another rig or name than was asked for
};

using Progress = std::function<void(std::size_t done, std::size_t all)>;  ///< bytes

/// Copies a campaign's folder, reads the copy again, and only then lets it be seen: by its name,
/// and in the index. Whoever is killed on the way leaves nothing that looks like a campaign; again,
/// it goes on; what others left that were killed is removed while nobody else delivers. The same
/// recording is there once, of whichever rig. A folder that lies in the archive already is only
/// registered. Throws.
[[nodiscard]] Delivery deliver(const std::string& campaign_folder, const Place& place,
                               const std::string& rig, const Progress& progress);
/// Reads the campaigns of an index' own folder that it has no results of; what cannot be read is
/// reported. For an index that a rig's recorder writes.
void read_results(Index& index, const std::string& folder, const std::string& rig,
                  const std::function<void(const std::string&)>& tell, const Progress& progress);
/// What is no campaign and cannot be looked at, and why.
using Strange = std::function<void(const std::string& path, const std::string& why)>;
/// The folders of campaigns in a folder, or itself if it is one; "RIG/CAMPAIGN" too. By name.
[[nodiscard]] std::vector<std::string> campaign_folders(const std::string& folder,
                                                        const Strange& strange);

/// This machine's name, for a rig that has none.
[[nodiscard]] std::string host_name();

}  // namespace vibrig::archive
