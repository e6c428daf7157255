#include "daemon/configuration/nearest.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <vector>

#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

namespace {

/// Insertions, deletions and substitutions from one word to the other (Levenshtein).
std::size_t edits(const std::string& a, const std::string& b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) {
        row[j] = j;
    }
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

std::string last_part(const std::string& key) { return key.substr(key.rfind('.') + 1); }

std::set<std::string> candidates(bool table) {
    std::set<std::string> names;
    for (const Key& key : schema()) {
        if (!table) {
            names.insert(key.name);
            continue;
        }
        for (std::size_t dot = key.name.find('.'); dot != std::string::npos;
             dot = key.name.find('.', dot + 1)) {
            names.insert(key.name.substr(0, dot));
        }
    }
    return names;
}

}  // namespace

std::string nearest_key(const std::string& key, bool table) {
    constexpr std::size_t kLongest = 100;
    if (key.size() > kLongest) {
        return "";
    }
    std::string best;
    std::size_t best_edits = std::max<std::size_t>(2, last_part(key).size() / 3) + 1;
    for (const std::string& name : candidates(table)) {
        const std::size_t whole = edits(key, name);
        // The right name in the wrong section is one mistake, whatever the sections are called.
        const std::size_t part = last_part(key) == last_part(name) ? 1 : whole;
        if (std::min(whole, part) < best_edits) {
            best_edits = std::min(whole, part);
            best = name;
        }
    }
    return best;
}

}  // namespace vibrig::configuration
