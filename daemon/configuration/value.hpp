#pragma once

#include <toml++/toml.h>

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/problems.hpp"

namespace vibrig::configuration {

[[nodiscard]] Place place_of(const toml::source_region& source);

/// The value as a person wrote it, with its type when that is the problem: `"fast" (a string)`.
[[nodiscard]] std::string describe(const toml::node& node);

/// What a file says under a key.
struct Entry {
    const toml::node& node;
    std::string key;
    Problems& problems;

    void refuse(const std::string& found, const std::string& expected) const;
    /// As it was found.
    void refuse(const std::string& expected) const { refuse(describe(node), expected); }

    /// "key.name", and "key[i]", at a node within this one.
    [[nodiscard]] Entry part(const toml::node& inner, const std::string& name) const;
    [[nodiscard]] Entry element(std::size_t i) const;

    // These give what they read, or add a problem.
    /// A finite number within the range (a TOML integer will do).
    [[nodiscard]] std::optional<double> number(Range range, const std::string& unit) const;
    [[nodiscard]] std::optional<std::array<double, 3>> triple(const std::array<Range, 3>& ranges,
                                                              const std::string& unit) const;
    /// A string for which the rule has no other words; of no string it says `kind`.
    [[nodiscard]] std::optional<std::string> text(const std::string& kind,
                                                  const TextRule& rule) const;
    /// An array of `low` to `high` elements; else nullptr.
    [[nodiscard]] const toml::array* array(std::size_t low, std::size_t high,
                                           const std::string& elements) const;
    /// The elements of such an array as `read` gives them for each one's Entry.
    template <class Read>
    [[nodiscard]] auto elements(std::size_t low, std::size_t high, const std::string& what,
                                Read read) const {
        std::vector<typename decltype(read(*this))::value_type> list;
        const toml::array* all = array(low, high, what);
        for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
            if (auto one = read(element(i))) list.push_back(std::move(*one));
        }
        const bool good = all != nullptr && list.size() == all->size();
        return good ? std::optional(std::move(list)) : std::nullopt;
    }
    /// `row` of its tables one by one; `expected`: what it is where it has some, so many at most.
    template <class Row>
    void tables(const std::string& expected, Row row,
                std::size_t at_most = std::numeric_limits<std::size_t>::max()) const {
        const toml::array* rows = node.as_array();
        if (rows == nullptr || rows->size() > at_most) return refuse(expected);
        for (std::size_t i = 0; i < rows->size(); ++i) {
            const Entry one = element(i);
            if (const auto* table = one.node.as_table()) {
                row(one, *table);
            } else {
                one.refuse("a table");
            }
        }
    }
};

/// "a number from 2 to 600 s"
[[nodiscard]] std::string expected_number(Range range, const std::string& unit);

/// Shortest TOML that reads back as the same number.
[[nodiscard]] std::string write_number(double value);
/// "[a, b]" of what `write` makes of each value.
template <class Values, class Write>
[[nodiscard]] std::string write_list(const Values& values, Write write) {
    std::string text;
    for (const auto& value : values) text += (text.empty() ? "" : ", ") + write(value);
    return "[" + text + "]";
}
[[nodiscard]] std::string write_triple(const std::array<double, 3>& value);
[[nodiscard]] std::string write_text(const std::string& value);
/// JSON Schema of one number.
[[nodiscard]] std::string schema_of(Range range);
/// JSON Schema of an array of `low` to `high` elements.
[[nodiscard]] std::string schema_of_array(const std::string& element, std::size_t low,
                                          std::size_t high);
/// A bound as a person would write it: no ".0".
[[nodiscard]] std::string plain(double value);
/// For people: five significant digits are plenty for a limit.
[[nodiscard]] std::string rounded(double value);

}  // namespace vibrig::configuration
