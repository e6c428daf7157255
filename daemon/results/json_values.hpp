#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "proto/json_number.hpp"

namespace vibrig::tool {

using proto::number_or_null;

/// null for an empty text.
[[nodiscard]] inline nlohmann::ordered_json text_or_null(const std::string& text) {
    return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
}
[[nodiscard]] nlohmann::ordered_json numbers_or_null(const auto& values) {
    auto list = nlohmann::ordered_json::array();
    for (const double value : values) list.push_back(number_or_null(value));
    return list;
}

}  // namespace vibrig::tool
