#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

namespace {

constexpr std::size_t kWidestColumn = 44;

std::string padded(const std::string& text, std::size_t width) {
    return text.size() < width ? text + std::string(width - text.size(), ' ') : text;
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

std::string format_schema() {
    std::vector<std::vector<std::string>> rows{
        {"key", "type", "unit", "default", "bounds", "meaning"}};
    Configuration defaults;
    for (const Key& key : schema()) {
        std::string value = key.write(defaults);
        if (key.type == "positions") {
            value = "(table 1)";
        } else if (key.type == "tables") {
            value = "(see --check)";
        }
        rows.push_back({key.name, key.type, key.unit.empty() ? "-" : key.unit,
                        value.empty() ? "-" : value, key.bounds.empty() ? "-" : key.bounds,
                        key.doc});
    }
    return columns(rows);
}

}  // namespace vibrig::configuration
