#pragma once

#include <array>
#include <cstdint>
#include <ctime>
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
/// "2026-03-01T08:00:00Z"
[[nodiscard]] inline std::string iso_text(std::int64_t utc_ns) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    const std::time_t seconds = utc_ns / kSecond;
    std::tm fields{};
    std::array<char, 32> text{};
    if (gmtime_r(&seconds, &fields) == nullptr) return {};
    return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &fields)};
}

}  // namespace vibrig::tool
