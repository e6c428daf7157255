#pragma once

#include <string>

namespace vibrig::configuration {

/// The known key (or table) that a person most likely meant; empty if none is near.
[[nodiscard]] std::string nearest_key(const std::string& key, bool table);

}  // namespace vibrig::configuration
