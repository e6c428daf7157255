#pragma once

#include <string>
#include <vector>

#include "daemon/archive/entry.hpp"

namespace vibrig::archive {

/// In each campaign's folder in the archive: what there is to be, as it was verified.
inline constexpr const char* kManifestName = "archive.json";

/// Every file of a campaign's folder with its digest, by name. Throws std::runtime_error.
[[nodiscard]] std::vector<File> list_files(const std::string& folder);
/// Hash of the recording itself: what programs write beside it later does not change it.
[[nodiscard]] std::string campaign_hash(const std::vector<File>& files);
/// Throws ArchiveError that names `source` where a name is not UTF-8.
[[nodiscard]] std::string manifest_json(const Entry& entry, const std::string& source);
/// What a folder's manifest says; empty without one.
struct Origin {
    std::string rig, hash;
};
[[nodiscard]] Origin origin_in(const std::string& folder);

/// What is wrong with a folder that is to have these files, a line each; empty: nothing.
[[nodiscard]] std::vector<std::string> differences(const std::string& folder,
                                                   const std::vector<File>& expected);

}  // namespace vibrig::archive
