#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace vibrig::proto {

/// As JSON has it. Texts of files, of the wire and of people may be no UTF-8: U+FFFD stands in such
/// a place. `indent`: spaces a level, -1: all in one line.
template <class Json>
[[nodiscard]] std::string json_text(const Json& of, int indent = -1) {
    return of.dump(indent, ' ', false, Json::error_handler_t::replace);
}

/// What the object has at the key; empty: no text.
template <class Json>
[[nodiscard]] std::string text_at(const Json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_string() ? found->template get<std::string>() : "";
}

}  // namespace vibrig::proto
