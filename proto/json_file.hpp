#pragma once

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "proto/text.hpp"

namespace vibrig::proto {

/// The JSON of a file's text. Throws std::runtime_error, FILE: REFUSAL; line and column that are
/// none; or it names a key that an object has twice, of which the last alone would count.
template <class Json = nlohmann::json>
[[nodiscard]] Json parse_json(const std::string& text, const std::string& file,
                              const std::string& refusal) {
    std::vector<std::set<std::string>> open;  // keys of each object that has not ended
    std::optional<std::string> twice;
    const auto look = [&](int, typename Json::parse_event_t event, Json& parsed) {
        using Event = typename Json::parse_event_t;
        if (event == Event::object_start) open.emplace_back();
        if (event == Event::object_end) open.pop_back();
        if (event == Event::key && !open.back().insert(parsed.template get<std::string>()).second)
            twice = twice.value_or(parsed.template get<std::string>());
        return true;
    };
    try {
        Json json = Json::parse(text, look);
        if (!twice) return json;
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
    throw std::runtime_error(file + ": found \"" + printable(*twice) +
                             "\" twice in one object, expected it once");
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
