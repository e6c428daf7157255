#pragma once

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "proto/text.hpp"

namespace vibrig::proto {

/// The JSON of a file's text. Throws std::runtime_error, FILE: REFUSAL; line and column that are
/// none.
template <class Json = nlohmann::json>
[[nodiscard]] Json parse_json(const std::string& text, const std::string& file,
                              const std::string& refusal) {
    try {
        return Json::parse(text);
    } catch (const nlohmann::json::parse_error& error) {
        const std::string before = text.substr(0, error.byte > 0 ? error.byte - 1 : 0);
        const auto line = std::count(before.begin(), before.end(), '\n') + 1;
        const std::size_t column = before.size() - (before.rfind('\n') + 1) + 1;
        throw std::runtime_error(file + ": " + refusal + "; line " + std::to_string(line) +
                                 ", column " + std::to_string(column) +
                                 (before.size() >= text.size() ? ": the text ends" : ""));
    } catch (const nlohmann::json::out_of_range&) {
        throw std::runtime_error(file + ": " + refusal + "; a number is beyond all that are known");
    }
}

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
    return parse_json(text, path, "found no JSON, expected it");
}

}  // namespace vibrig::proto
