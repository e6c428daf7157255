#include "daemon/configuration/problems.hpp"

#include <algorithm>
#include <utility>

#include "proto/text.hpp"

namespace vibrig::configuration {

namespace {

/// A file that is not a configuration at all would otherwise fill the screen.
constexpr std::size_t kShown = 100;

}  // namespace

void Problems::add(Place place, std::string key, std::string found, std::string expected) {
    problems_.push_back({place, std::move(key), std::move(found), std::move(expected)});
}

bool Problems::concern(const std::string& key) const {
    return std::any_of(problems_.begin(), problems_.end(), [&](const Problem& problem) {
        return problem.key.compare(0, key.size(), key) == 0 &&
               (problem.key.size() == key.size() || problem.key[key.size()] == '.' ||
                problem.key[key.size()] == '[');
    });
}

std::string Problems::text(const std::string& file) const {
    std::vector<Problem> sorted = problems_;
    std::stable_sort(sorted.begin(), sorted.end(), [](const Problem& a, const Problem& b) {
        // What does not stand in the file comes last: line 0 wraps to the largest number.
        return std::pair(a.place.line - 1U, a.place.column) <
               std::pair(b.place.line - 1U, b.place.column);
    });
    std::string text;
    for (std::size_t i = 0; i < std::min(sorted.size(), kShown); ++i) {
        const Problem& problem = sorted[i];
        text += text.empty() ? "" : "\n";
        text += file;
        if (problem.place.line > 0) {
            text += ":" + std::to_string(problem.place.line) + ":" +
                    std::to_string(problem.place.column);
        }
        text += ": " + (problem.key.empty() ? "" : proto::printable(problem.key, 120) + ": ") +
                "found " + problem.found + (problem.expected.empty() ? "" : ", expected ") +
                problem.expected;
    }
    if (sorted.size() > kShown) {
        text += "\n" + file + ": and " + std::to_string(sorted.size() - kShown) + " more";
    }
    return text;
}

}  // namespace vibrig::configuration
