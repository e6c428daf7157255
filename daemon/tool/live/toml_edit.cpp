#include "daemon/tool/live/toml_edit.hpp"

#include <toml++/toml.h>
#include <cstddef>
#include <stdexcept>
#include <string_view>

namespace vibrig::tool {

namespace {

/// Where line and column, both from 1, columns in characters, are in the text.
std::size_t place_in(std::string_view text, const toml::source_position& at) {
    std::size_t i = 0;
    for (toml::source_index line = 1; line < at.line && i < text.size(); ++line) {
        const auto end = text.find('\n', i);
        i = end == std::string_view::npos ? text.size() : end + 1;
    }
    for (toml::source_index column = 1; column < at.column && i < text.size(); ++column) {
        ++i;
        while (i < text.size() && (static_cast<unsigned char>(text[i]) & 0xC0U) == 0x80U) ++i;
    }
    return i;
}

std::size_t end_of_line(std::string_view text, std::size_t from) {
    const auto end = text.find('\n', from);
    return end == std::string_view::npos ? text.size() : end;
}

/// Of the line before this one; empty: it is none.
std::string comment_above(std::string_view text, const toml::source_position& at) {
    if (at.line < 2) return {};
    const auto begin = place_in(text, {at.line - 1, 1});
    const auto line = text.substr(begin, end_of_line(text, begin) - begin);
    return line.starts_with("# ") ? std::string(line.substr(2)) : std::string();
}

void gather(const toml::table& table, const std::string& prefix, std::string_view text,
            std::vector<TomlValue>& values) {
    for (const auto& [key, node] : table) {
        const std::string name = prefix + std::string(key.str());
        if (const auto* inner = node.as_table(); inner != nullptr) {
            gather(*inner, name + ".", text, values);
            continue;
        }
        const auto& where = node.source();
        const auto begin = place_in(text, where.begin), end = place_in(text, where.end);
        values.push_back(
            {name, std::string(text.substr(begin, end - begin)), comment_above(text, where.begin)});
    }
}

void set(std::string& text, const std::string& file, const TomlValue& value) {
    const toml::table root = toml::parse(text, file);
    if (const auto node = root.at_path(value.key); node) {
        const auto& where = node.node()->source();
        const auto begin = place_in(text, where.begin), end = place_in(text, where.end);
        text.replace(begin, end - begin, value.value);
        return;
    }
    const auto dot = value.key.rfind('.');
    const std::string table = value.key.substr(0, dot);
    const std::string line = value.key.substr(dot + 1) + " = " + value.value +
                             (value.comment.empty() ? "" : "  # " + value.comment) + "\n";
    if (const auto node = root.at_path(table); node && node.is_table()) {
        const auto begin = place_in(text, node.node()->source().begin);
        if (begin < text.size() && text[begin] == '[') {
            auto end = end_of_line(text, begin);
            if (end == text.size()) text += '\n';
            text.insert(end + 1, line);
            return;
        }
    }
    if (!text.empty() && text.back() != '\n') text += '\n';
    text += "\n[" + table + "]\n" + line;
}

}  // namespace

std::string with_values(std::string text, const std::string& file,
                        const std::vector<TomlValue>& values) {
    for (const TomlValue& value : values) {
        try {
            set(text, file, value);
            static_cast<void>(toml::parse(text, file));
        } catch (const toml::parse_error& error) {
            throw std::runtime_error(file + ": " + value.key + " cannot be set by this program (" +
                                     std::string(error.description()) + "): write " + value.key +
                                     " = " + value.value + " by hand");
        }
    }
    return text;
}

std::vector<TomlValue> values_in(const std::string& text, const std::string& file) {
    std::vector<TomlValue> values;
    try {
        gather(toml::parse(text, file), "", text, values);
    } catch (const toml::parse_error& error) {
        throw std::runtime_error(file + ":" + std::to_string(error.source().begin.line) + ": " +
                                 std::string(error.description()));
    }
    return values;
}

}  // namespace vibrig::tool
