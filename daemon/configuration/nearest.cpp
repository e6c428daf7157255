#include "daemon/configuration/nearest.hpp"

#include <algorithm>
#include <limits>
#include <set>

#include "daemon/configuration/schema.hpp"
#include "proto/edits.hpp"

namespace vibrig::configuration {

namespace {

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
        const std::size_t whole = proto::edits(key, name);
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
