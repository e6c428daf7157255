#include "daemon/results/result_difference.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

using Compared = nlohmann::ordered_json;

/// Every result has these; others came with later versions.
constexpr std::array kInEvery{"parameters", "verdict"};
/// Marks are known to the daemon alone, and a build says nothing of the numbers.
constexpr std::array kNotCompared{"warnings", "instruction_set", "compiler"};

/// The unit's type, as the archive had it then.
constexpr const char* kOfTheArchive = "type_prior";

std::string excerpt(const Compared& of) {
    constexpr std::size_t kLongest = 80;
    const std::string text = proto::printable(proto::json_text(of));
    return text.size() <= kLongest ? text : text.substr(0, kLongest) + "...";
}

/// Of an element that has a name it, else the number.
std::string place_of(const Compared& element, std::size_t number) {
    if (element.is_object() && element.contains("name") && element["name"].is_string())
        return element["name"].get<std::string>();
    return std::to_string(number);
}

std::string first_difference(const std::string& where, const Compared& was, const Compared& is) {
    if (was.is_object() && is.is_object()) {
        for (const auto& [key, value] : is.items()) {
            const auto found = was.find(key);
            if (found == was.end())
                return where + " " + key + ": found nothing, the replay gives " + excerpt(value);
            auto words = first_difference(where + " " + key, *found, value);
            if (!words.empty()) return words;
        }
        if (was.size() == is.size()) return {};
    }
    if (was.is_array() && is.is_array() && was.size() == is.size()) {
        for (std::size_t i = 0; i < is.size(); ++i) {
            auto words = first_difference(where + " " + place_of(is[i], i), was[i], is[i]);
            if (!words.empty()) return words;
        }
        return {};
    }
    if (was == is) return {};
    return where + ": found " + excerpt(was) + ", the replay gives " + excerpt(is);
}

}  // namespace

std::string result_difference(const std::string& recorded, const std::string& replayed) {
    const Compared was = Compared::parse(recorded, nullptr, false);
    const Compared is = Compared::parse(replayed, nullptr, false);
    if (!was.is_object() || !is.is_object())
        return "/result: found no JSON object, expected the campaign's result";
    for (const auto& [key, value] : is.items()) {
        if (std::ranges::find(kNotCompared, key) != kNotCompared.end()) continue;
        const auto found = was.find(key);
        if (found == was.end()) {
            if (std::ranges::find(kInEvery, key) == kInEvery.end()) continue;
            return "/result: found no " + key + ", expected what the replay gives";
        }
        auto words = first_difference("/result: " + key, *found, value);
        if (!words.empty()) return words;
    }
    for (const auto& [key, value] : was.items()) {
        if (!is.contains(key) && key != kOfTheArchive)
            return "/result: found " + key + " in it, which the replay does not give";
    }
    return {};
}

}  // namespace vibrig::tool
