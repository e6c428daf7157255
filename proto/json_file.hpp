#pragma once

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "proto/text.hpp"

namespace vibrig::proto {

/// The JSON in a file. Throws std::runtime_error that names it: it cannot be read, or has none;
/// then with the line and column that are none.
[[nodiscard]] inline nlohmann::json read_json(const std::string& path) {
    constexpr std::size_t kLargest = std::size_t{1} << 30;
    std::string text;
    try {
        text = read_whole_file(path, kLargest);
    } catch (const std::runtime_error& error) {
        throw std::runtime_error(path + ": cannot be read, expected a JSON file (" + error.what() +
                                 ")");
    }
    try {
        return nlohmann::json::parse(text);
    } catch (const nlohmann::json::parse_error& error) {
        const std::string before = text.substr(0, error.byte > 0 ? error.byte - 1 : 0);
        const auto line = std::count(before.begin(), before.end(), '\n') + 1;
        const std::size_t column = before.size() - (before.rfind('\n') + 1) + 1;
        throw std::runtime_error(path + ": found no JSON, expected it; line " +
                                 std::to_string(line) + ", column " + std::to_string(column) +
                                 (before.size() >= text.size() ? ": the text ends" : ""));
    }
}

}  // namespace vibrig::proto
