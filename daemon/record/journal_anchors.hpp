#pragma once

#include <string>
#include <vector>

#include "daemon/journal/signed_head.hpp"

namespace vibrig::record {

/// Signed heads of the journal that the newest recordings in `folder` carry; what cannot be read
/// carries none. Looks at few files: a start waits for it.
[[nodiscard]] std::vector<journal::Anchor> journal_anchors(const std::string& folder);

}  // namespace vibrig::record
