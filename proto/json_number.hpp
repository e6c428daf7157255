#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

namespace vibrig::proto {

/// JSON has neither NaN nor infinity: they are null.
[[nodiscard]] inline nlohmann::ordered_json number_or_null(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

}  // namespace vibrig::proto
