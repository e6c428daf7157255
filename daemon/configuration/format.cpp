#include <toml++/toml.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/forms.hpp"
#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

namespace {

constexpr std::size_t kWidestColumn = 44;

// Of the list of all keys: a terminal's 100 columns hold each line.
constexpr std::size_t kWidest = 98, kKeyColumn = 34, kInside = 4;

std::string padded(const std::string& text, std::size_t width) {
    return text.size() < width ? text + std::string(width - text.size(), ' ') : text;
}

/// In lines of `kWidest` at most, broken at blanks; what goes on stands a little further in. What
/// has no blank is broken where the line ends.
std::string wrapped(std::string text, std::size_t in) {
    std::string lines;
    for (bool first = true; !text.empty(); first = false) {
        const std::size_t indent = first ? in : in + kInside, room = kWidest - indent;
        std::size_t end = text.size();
        if (end > room) {
            const auto blank = text.rfind(' ', room);
            end = blank == std::string::npos || blank < room / 2 ? room : blank;
        }
        lines += std::string(indent, ' ') + text.substr(0, end) + "\n";
        text.erase(0, std::max(end, text.find_first_not_of(' ', end)));
        if (text.find_first_not_of(' ') == std::string::npos) break;
    }
    return lines;
}

/// Rows of text in columns, two blanks apart; one long cell (a list of positions) does not push all
/// rows out.
std::string columns(const std::vector<std::vector<std::string>>& rows) {
    std::vector<std::size_t> width;
    for (const auto& row : rows) {
        width.resize(std::max(width.size(), row.size()), 0);
        for (std::size_t i = 0; i < row.size(); ++i) {
            if (row[i].size() <= kWidestColumn) {
                width[i] = std::max(width[i], row[i].size());
            }
        }
    }
    std::string text;
    for (const auto& row : rows) {
        std::string line;
        for (std::size_t i = 0; i < row.size(); ++i) {
            line += (i == 0 ? "" : "  ") + padded(row[i], width[i]);
        }
        line.erase(line.find_last_not_of(' ') + 1);
        text += line + "\n";
    }
    return text;
}

}  // namespace

std::string format_effective(const Loaded& loaded) {
    // Comments carry what TOML has no place for, so that the output is a configuration file itself.
    std::vector<std::vector<std::string>> rows{
        {"# key", "", "value", "# unit", "origin", "meaning"}};
    for (const EffectiveValue& value : loaded.effective) {
        rows.push_back({value.key, "=", value.value, "# " + (value.unit.empty() ? "-" : value.unit),
                        value.origin, value.doc});
    }
    return columns(rows);
}

nlohmann::ordered_json effective_json(const Loaded& loaded) {
    // The values are TOML, which its own library turns into JSON.
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const EffectiveValue& value : loaded.effective) {
        std::ostringstream json;
        json << toml::json_formatter{toml::parse("value = " + value.value)};
        list.push_back({{"key", value.key},
                        {"value", nlohmann::ordered_json::parse(json.str())["value"]},
                        {"unit", value.unit},
                        {"origin", value.origin},
                        {"meaning", value.doc}});
    }
    return list;
}

std::string format_schema() {
    std::string text = wrapped("KEY  TYPE, UNIT, BOUNDS", 0) + wrapped("= default", kInside) +
                       wrapped("meaning", kInside);
    Configuration defaults;
    std::string section;
    for (const Key& key : schema()) {
        if (const auto in = key.name.substr(0, key.name.find('.')); in != section) {
            section = in;
            text += "\n[" + section + "]\n";
        }
        std::string value = key.write(defaults);
        if (key.type == "positions") {
            value = "(table 1)";
        } else if (key.type == "tables") {
            value = "(see --check)";
        }
        std::string what = padded(key.name + "  ", kKeyColumn) + key.type;
        for (const std::string& more : {key.unit, key.bounds})
            what += more.empty() ? "" : ", " + more;
        text += wrapped(what, 0) + wrapped(value.empty() ? "" : "= " + value, kInside) +
                wrapped(key.doc, kInside);
    }
    return text;
}

}  // namespace vibrig::configuration
