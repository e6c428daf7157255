#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

namespace vibrig::study {

/// JSON has no NaN.
[[nodiscard]] inline nlohmann::ordered_json number(double x) {
    return std::isfinite(x) ? nlohmann::ordered_json(x) : nlohmann::ordered_json(nullptr);
}

}  // namespace vibrig::study
