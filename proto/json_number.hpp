#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

namespace vibrig::proto {

/// JSON has neither NaN nor infinity: they are null.
[[nodiscard]] inline nlohmann::ordered_json number_or_null(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

/// NaN where it is none.
template <class Json>
[[nodiscard]] double number_or_nan(const Json& value) {
    return value.is_number() ? value.template get<double>() : std::nan("");
}

}  // namespace vibrig::proto
