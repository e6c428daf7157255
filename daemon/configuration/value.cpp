#include "daemon/configuration/value.hpp"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <system_error>

#include "proto/text.hpp"

namespace vibrig::configuration {

Place place_of(const toml::source_region& source) {
    return {source.begin.line, source.begin.column};
}

std::string plain(double value) {
    if (std::isnan(value)) {
        return "nan";
    }
    if (std::isinf(value)) {
        return value < 0 ? "-inf" : "inf";
    }
    // Nobody writes 6e+05 for 600000; 0.0001 is still easy to read, 1e-09 is not as a decimal.
    const double size = std::abs(value);
    const auto format = size == 0 || (size >= 1e-5 && size < 1e7) ? std::chars_format::fixed
                                                                  : std::chars_format::general;
    std::array<char, 64> buffer{};
    const auto [end, error] =
        std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, format);
    return error == std::errc{} ? std::string(buffer.data(), end) : std::to_string(value);
}

std::string rounded(double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.5g", value);
    return text.data();
}

std::string write_number(double value) {
    std::string text = plain(value);
    // TOML tells numbers and integers apart; a number keeps its point.
    if (text.find_first_of(".en") == std::string::npos) {
        text += ".0";
    }
    return text;
}

std::string write_triple(const std::array<double, 3>& value) {
    return write_list(value, write_number);
}

std::string write_text(const std::string& value) {
    std::ostringstream out;
    const toml::value<std::string> node{value};
    out << toml::toml_formatter{node, toml::format_flags::none};
    return out.str();
}

std::string describe(const toml::node& node) {
    switch (node.type()) {
        case toml::node_type::string:
            return "\"" + proto::printable(node.as_string()->get(), kQuotedValue) + "\" (a string)";
        case toml::node_type::integer:
            return std::to_string(node.as_integer()->get());
        case toml::node_type::floating_point:
            return write_number(node.as_floating_point()->get());
        case toml::node_type::boolean:
            return node.as_boolean()->get() ? "true" : "false";
        case toml::node_type::array:
            return "an array of " + std::to_string(node.as_array()->size());
        case toml::node_type::table:
            return "a table";
        case toml::node_type::none:
        case toml::node_type::date:
        case toml::node_type::time:
        case toml::node_type::date_time:
            break;
    }
    return "a date or time";
}

std::string expected_number(Range range, const std::string& unit) {
    return "a number from " + plain(range.low) + " to " + plain(range.high) +
           (unit.empty() ? "" : " " + unit);
}

void Entry::refuse(const std::string& found, const std::string& expected) const {
    problems.add(place_of(node.source()), key, found, expected);
}

Entry Entry::part(const toml::node& inner, const std::string& name) const {
    return {inner, key + "." + name, problems};
}

Entry Entry::element(std::size_t i) const {
    return {*node.as_array()->get(i), key + "[" + std::to_string(i) + "]", problems};
}

std::optional<double> Entry::number(Range range, const std::string& unit) const {
    double value = std::nan("");
    if (const auto* floating = node.as_floating_point()) {
        value = floating->get();
    } else if (const auto* whole = node.as_integer()) {
        value = static_cast<double>(whole->get());
    }
    // Written so that NaN fails.
    if (!(value >= range.low && value <= range.high)) {
        refuse(expected_number(range, unit));
        return std::nullopt;
    }
    return value;
}

std::optional<std::array<double, 3>> Entry::triple(const std::array<Range, 3>& ranges,
                                                   const std::string& unit) const {
    auto range = ranges.begin();
    const auto value =
        elements(3, 3, "numbers", [&](const Entry& one) { return one.number(*range++, unit); });
    if (!value) return std::nullopt;
    return std::array{(*value)[0], (*value)[1], (*value)[2]};
}

std::optional<std::string> Entry::text(const std::string& kind, const TextRule& rule) const {
    const auto* value = node.as_string();
    const std::string expected = value == nullptr ? kind : rule(value->get());
    if (expected.empty()) return value->get();
    refuse(value == nullptr ? describe(node)
                            : "\"" + proto::printable(value->get(), kQuotedValue) + "\"",
           expected);
    return std::nullopt;
}

const toml::array* Entry::array(std::size_t low, std::size_t high, const std::string& what) const {
    const toml::array* array = node.as_array();
    if (array != nullptr && array->size() >= low && array->size() <= high) return array;
    const std::string count =
        low == high ? std::to_string(low) : std::to_string(low) + " to " + std::to_string(high);
    refuse("an array of " + count + " " + what);
    return nullptr;
}

std::string schema_of(Range range) {
    return R"({"type":"number","minimum":)" + write_number(range.low) + R"(,"maximum":)" +
           write_number(range.high) + '}';
}

std::string schema_of_array(const std::string& element, std::size_t low, std::size_t high) {
    return R"({"type":"array","items":)" + element + R"(,"minItems":)" + std::to_string(low) +
           R"(,"maxItems":)" + std::to_string(high) + '}';
}

}  // namespace vibrig::configuration
