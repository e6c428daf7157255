#include "daemon/guard/keys.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <sstream>

#include "daemon/guard/settings.hpp"

namespace vibrig::guard {

namespace {

std::string in_quotes(const std::string& text) {
    std::ostringstream out;
    const toml::value<std::string> node{text};
    out << toml::toml_formatter{node, toml::format_flags::none};
    return out.str();
}

/// Shortest text that reads back as the same number.
std::string plain(double value) {
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return {text.data(), end};
}

/// As TOML: a number keeps its point.
std::string written(double value) {
    const auto text = plain(value);
    return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

/// The value as a person wrote it, with its type.
std::string described(const toml::node& node) {
    if (const auto* text = node.as_string()) return in_quotes(text->get()) + " (a string)";
    if (const auto* whole = node.as_integer()) return std::to_string(whole->get());
    if (const auto* real = node.as_floating_point()) return written(real->get());
    if (const auto* flag = node.as_boolean()) return flag->get() ? "true" : "false";
    if (node.is_array()) return "an array";
    return node.is_table() ? "a table" : "a date or time";
}

}  // namespace

Keys::Keys(const std::string& text, std::string file) : file_(std::move(file)) {
    try {
        table_ = toml::parse(text, file_);
    } catch (const toml::parse_error& error) {
        throw SettingsError(placed(error.source()) +
                            ": not TOML: " + std::string(error.description()));
    }
}

void Keys::wrong(const std::string& key, const toml::node* node, const std::string& found,
                 const std::string& expected) {
    problems_ += (node != nullptr ? placed(node->source()) : file_) + ": " +
                 key_error(key, found, expected) + "\n";
}

std::string Keys::placed(const toml::source_region& source) const {
    return file_ + ":" + std::to_string(source.begin.line) + ":" +
           std::to_string(source.begin.column);
}

std::string Keys::place(const std::string& key) {
    const auto* node = at(key).node();
    return node == nullptr ? std::string() : placed(node->source());
}

void Keys::refuse(const std::string& key, const std::string& found, const std::string& expected) {
    const auto* node = at(key).node();
    wrong(key, node, node == nullptr ? found + " (default)" : found, expected);
}

void Keys::refuse_unknown(const std::set<std::string>& keys, const std::set<std::string>& tables) {
    known_.insert(keys.begin(), keys.end());
    for (const auto& name : tables) known_.insert(name);
    look_for_unknown(table_, "");
}

void Keys::look_for_unknown(const toml::table& table, const std::string& prefix) {
    for (const auto& [name, node] : table) {
        const std::string word(name.str());
        const std::string key = prefix + word;
        // A dot in a quoted name parts nothing.
        const bool plain_name = word.find_first_of(".[") == std::string::npos;
        const bool section = plain_name && is_table(key);
        if (section && node.is_table()) {
            look_for_unknown(*node.as_table(), key + ".");
        } else if (plain_name && known_.contains(key)) {
            continue;
        } else if (section) {
            wrong(key, &node, described(node), "a table");
        } else {
            const bool bare = std::all_of(word.begin(), word.end(), [](unsigned char letter) {
                return std::isalnum(letter) != 0 || letter == '_' || letter == '-';
            });
            problems_ += placed(name.source()) + ": " +
                         key_error(prefix + (bare ? word : in_quotes(word)),
                                   node.is_table() ? "an unknown table" : "an unknown key",
                                   names_in(prefix)) +
                         "\n";
        }
    }
}

bool Keys::is_table(const std::string& key) const {
    const auto next = known_.lower_bound(key + ".");
    return next != known_.end() && next->starts_with(key + ".");
}

std::string Keys::names_in(const std::string& prefix) const {
    std::set<std::string> names;
    for (const auto& key : known_)
        if (key.starts_with(prefix))
            names.insert(key.substr(prefix.size(), key.find('.', prefix.size()) - prefix.size()));
    std::string list;
    for (const auto& name : names) list += (list.empty() ? "" : ", ") + name;
    return (names.size() > 1 ? "one of " : "") + list;
}

void Keys::believe(const std::string& key, const std::string& value) {
    const auto* node = at(key).node();
    believed_ +=
        key + " = " + value + "  # " +
        (node == nullptr ? "default" : file_ + ":" + std::to_string(node->source().begin.line)) +
        "\n";
}

std::string Keys::text(const std::string& key, const std::string& otherwise) {
    std::string value = otherwise;
    if (const auto* node = at(key).node()) {
        if (const auto* text = node->as_string()) {
            value = text->get();
        } else {
            wrong(key, node, described(*node), "a string");
        }
    }
    if (value.find('\0') != std::string::npos) refuse(key, "a zero byte", "text");
    believe(key, in_quotes(value));
    return value;
}

bool Keys::boolean(const std::string& key, bool otherwise) {
    bool value = otherwise;
    if (const auto* node = at(key).node()) {
        if (const auto* flag = node->as_boolean()) {
            value = flag->get();
        } else {
            wrong(key, node, described(*node), "true or false");
        }
    }
    believe(key, value ? "true" : "false");
    return value;
}

double Keys::number(const std::string& key, double otherwise, double low, double high) {
    double value = otherwise;
    if (const auto* node = at(key).node()) {
        const auto found = node->is_number() ? node->value<double>() : std::nullopt;
        if (found && *found >= low && *found <= high) {
            value = *found;
        } else {
            wrong(key, node, described(*node),
                  "a number from " + plain(low) + " to " + plain(high));
        }
    }
    believe(key, written(value));
    return value;
}

int Keys::integer(const std::string& key, int otherwise, int low, int high) {
    std::int64_t value = otherwise;
    if (const auto* node = at(key).node()) {
        const auto* whole = node->as_integer();
        if (whole != nullptr && whole->get() >= low && whole->get() <= high) {
            value = whole->get();
        } else {
            wrong(key, node, described(*node),
                  "a whole number from " + std::to_string(low) + " to " + std::to_string(high));
        }
    }
    believe(key, std::to_string(value));
    return static_cast<int>(value);
}

std::size_t Keys::choice(const std::string& key, std::size_t otherwise,
                         const std::vector<std::string>& words) {
    std::size_t value = otherwise;
    if (const auto* node = at(key).node()) {
        const auto* text = node->as_string();
        const auto found =
            text == nullptr ? words.end() : std::find(words.begin(), words.end(), text->get());
        if (found != words.end()) {
            value = static_cast<std::size_t>(found - words.begin());
        } else {
            std::string expected;
            for (std::size_t i = 0; i < words.size(); ++i)
                expected += (i == 0                  ? "\""
                             : i + 1 == words.size() ? " or \""
                                                     : ", \"") +
                            words[i] + '"';
            wrong(key, node, described(*node), expected);
        }
    }
    believe(key, in_quotes(words[value]));
    return value;
}

void Keys::numbers(const std::string& key, double* values, std::size_t count) {
    if (const auto* node = at(key).node()) {
        const auto* array = node->as_array();
        bool good = array != nullptr && array->size() == count;
        for (std::size_t i = 0; good && i < count; ++i) {
            const auto value = (*array)[i].is_number() ? (*array)[i].value<double>() : std::nullopt;
            good = value && std::isfinite(*value);
            if (good) values[i] = *value;
        }
        if (!good) wrong(key, node, described(*node), std::to_string(count) + " finite numbers");
    }
    std::string list;
    for (std::size_t i = 0; i < count; ++i) list += (i == 0 ? "" : ", ") + written(values[i]);
    // A row of a matrix is no key of its own in TOML.
    if (key.back() != ']') believe(key, "[" + list + "]");
}

std::vector<std::array<double, 2>> Keys::pairs(const std::string& key, const std::string& word) {
    std::vector<std::array<double, 2>> out;
    const auto* node = at(key).node();
    if (node == nullptr || (!word.empty() && node->is_string() && *node->as_string() == word)) {
        if (!word.empty()) believe(key, in_quotes(word));
        return out;
    }
    const auto* rows = node->as_array();
    bool good = rows != nullptr;
    for (std::size_t i = 0; good && i < rows->size(); ++i) {
        const auto* row = (*rows)[i].as_array();
        good = row != nullptr && row->size() == 2;
        std::array<double, 2> pair{};
        for (std::size_t k = 0; good && k < 2; ++k) {
            const auto value = (*row)[k].is_number() ? (*row)[k].value<double>() : std::nullopt;
            good = value && std::isfinite(*value) && *value > 0;
            if (good) pair[k] = *value;
        }
        good = good && (out.empty() || pair[0] > out.back()[0]);
        if (good) out.push_back(pair);
    }
    if (!good) {
        wrong(key, node, described(*node),
              (word.empty() ? "" : in_quotes(word) + " or ") +
                  "pairs [[hz, ratio], ..], growing frequencies");
        return {};
    }
    std::string list;
    for (const auto& [first, second] : out)
        list += (list.empty() ? "[" : ", [") + written(first) + ", " + written(second) + "]";
    believe(key, "[" + list + "]");
    return out;
}

}  // namespace vibrig::guard
