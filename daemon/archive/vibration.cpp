#include "daemon/archive/vibration.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <set>

namespace vibrig::archive {

namespace fs = std::filesystem;
using estimator::is_quadratic;

bool same_vibration(const std::optional<double>& one, const std::optional<double>& reference) {
    if (!one || !reference) return one.has_value() == reference.has_value();
    return *one != kAtNoFrequency && estimator::same_vibration(*one, *reference);
}

bool same_vibration(const Coefficients& one, const Coefficients& reference) {
    for (std::size_t i = 0; i < one.size(); ++i)
        if (one[i] && reference[i] && !same_vibration(one[i]->at_hz, reference[i]->at_hz))
            return false;
    return true;
}

std::string vibration_text(const std::optional<double>& at_hz) {
    if (!at_hz) return "of a vibration that is not noted";
    if (*at_hz < 0) return "at no single frequency";
    return *at_hz > 0 ? fmt::format("at {:.6g} Hz", *at_hz) : "static";
}

std::string vibrations_in(const Coefficients& of) {
    std::set<std::string> texts;
    for (std::size_t i = 0; i < of.size(); ++i)
        if (of[i] && is_quadratic(i)) texts.insert(vibration_text(of[i]->at_hz));
    return fmt::format("{}", fmt::join(texts, ", "));
}

Coefficients all_at(const std::optional<double>& hz) {
    Coefficients all;
    for (std::size_t i = 0; hz && i < all.size(); ++i)
        if (is_quadratic(i)) all[i].emplace().at_hz = hz;
    return all;
}

std::size_t count_of_other_vibrations(const Coefficients& of, const std::vector<Entry>& campaigns) {
    return static_cast<std::size_t>(std::ranges::count_if(
        campaigns, [&of](const Entry& one) { return !same_vibration(one.coefficients, of); }));
}

bool vibration_noted(const Coefficients& of) {
    for (std::size_t i = 0; i < of.size(); ++i)
        if (of[i] && is_quadratic(i) && !of[i]->at_hz) return false;
    return true;
}

void read_vibrations(Index& index, const std::string& folder, std::vector<Entry>& campaigns) {
    for (Entry& one : campaigns) {
        const fs::path path = fs::path(folder) / one.key;
        std::error_code none;
        if (vibration_noted(one.coefficients) || folder.empty() || !fs::exists(path, none))
            continue;
        try {
            const Entry recorded = read_recorded(path.string());
            for (std::size_t i = 0; i < one.coefficients.size(); ++i)
                if (one.coefficients[i] && recorded.coefficients[i])
                    one.coefficients[i]->at_hz = recorded.coefficients[i]->at_hz;
            if (index.database().writes()) index.note_vibration(one);
        } catch (const std::exception&) {
            // Who asks gets an answer without: what is wrong there `verify` names, and what could
            // not be noted is read again.
        }
    }
}

}  // namespace vibrig::archive
