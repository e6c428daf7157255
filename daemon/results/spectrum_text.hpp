#pragma once

#include <span>
#include <string>

#include "daemon/results/spectrum_result.hpp"

namespace vibrig::tool {

/// For people; empty with one frequency.
[[nodiscard]] std::string spectrum_text(const SpectrumResult& spectrum);

/// What a campaign of linear vibration cannot show, one statement each.
[[nodiscard]] std::span<const char* const> not_shown();

}  // namespace vibrig::tool
