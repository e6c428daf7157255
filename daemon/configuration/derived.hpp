// What follows from the keys that are stated, for keys that are not and for who works with them.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/problems.hpp"

namespace vibrig::configuration {

/// Places of the keys that a file states.
using Places = std::map<std::string, Place>;

/// A path in a file is relative to the file's folder.
void resolve(std::string& path, const std::filesystem::path& folder);
/// Defaults that depend on other keys, and what stands in files of its own: as --check shows it.
void derive_defaults(Configuration& c, const std::filesystem::path& folder, const Places& places,
                     Problems& problems);
/// What campaign and shaker take from the other sections, and the plan, stop by stop.
void derive_campaign(Configuration& c, const std::filesystem::path& folder, const Places& places,
                     Problems& problems);
/// What only a configuration without a problem has: where the opening check looks, and where the
/// isolators resonate.
void derive_opening(Configuration& c);

}  // namespace vibrig::configuration
