#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <vector>

#include "proto/text.hpp"

namespace vibrig::proto {

/// Insertions, deletions and substitutions from one word to the other (Levenshtein), cases being
/// one.
[[nodiscard]] inline std::size_t edits(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t substituted =
                diagonal + (same_name(a.substr(i - 1, 1), b.substr(j - 1, 1)) ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

/// A key or column that is hardly anything but `known`, misspelt: one letter is another, of more
/// than six two, or the unit is left out (frequency). What has a word more (spin_frequency_hz,
/// profile_id) is something else.
[[nodiscard]] inline bool misspelt(std::string_view name, std::string_view known) {
    constexpr std::size_t kLongest = 100, kShort = 6, kLettersPerEdit = 3;
    if (name.empty() || name.size() > kLongest) return false;
    if (name.size() < known.size() && known[name.size()] == '_' &&
        same_name(name, known.substr(0, name.size())))
        return true;
    const std::size_t found = edits(name, known);
    return found <= (name.size() > kShort ? 2U : 1U) && found * kLettersPerEdit <= name.size();
}

}  // namespace vibrig::proto
