#include "daemon/archive/vibration.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string_view>

namespace vibrig::archive {

namespace fs = std::filesystem;

bool is_quadratic(std::size_t position) {
    return estimator::parameter_unit(position) == std::string_view("deg/h/g^2");
}

bool same_vibration(const std::optional<double>& a, const std::optional<double>& b) {
    return a && b ? std::abs(*a - *b) <= kSameVibration_hz : a.has_value() == b.has_value();
}

bool same_vibration(const Coefficients& a, const Coefficients& b) {
    for (std::size_t i = 0; i < a.size(); ++i)
        if (a[i] && b[i] && !same_vibration(a[i]->at_hz, b[i]->at_hz)) return false;
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
        campaigns, [&of](const Entry& one) { return !same_vibration(of, one.coefficients); }));
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
