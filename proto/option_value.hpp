#pragma once

#include <CLI/Validators.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>

#include "proto/printed.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

inline constexpr double kAboveZero = std::numeric_limits<double>::min();
inline constexpr double kAnyLow = -std::numeric_limits<double>::max();
inline constexpr double kAnyHigh = std::numeric_limits<double>::max();

// What options of both programs, vibrig and vibrig-plant, may be given.

/// A finite number from `low` to `high`; of a list, each element. CLI11's own checks let NaN pass.
[[nodiscard]] inline CLI::Validator finite(double low = kAnyLow, double high = kAnyHigh) {
    std::string expected = "a finite number";
    if (low > kAnyLow) expected += low == kAboveZero ? " above 0" : printed(" from %g", low);
    if (high < kAnyHigh) expected += printed(" up to %g", high);
    return CLI::Validator(
        [low, high, expected](std::string& input) {
            double value = 0;
            const bool good = CLI::detail::lexical_cast(input, value) && std::isfinite(value) &&
                              value >= low && value <= high;
            return good ? std::string() : "found " + input + ", expected " + expected;
        },
        "");
}

/// A whole number from 0 that fits into 64 bits. CLI11 takes -1 for the largest one.
[[nodiscard]] inline CLI::Validator whole() {
    return CLI::Validator(
        [](std::string& input) {
            std::uint64_t value = 0;
            return read_number(input, value)
                       ? std::string()
                       : "found " + input + ", expected a whole number from 0";
        },
        "");
}

/// Where charts go: an SVG file or a folder, or a folder alone; `page`: an HTML file, too. A name
/// that ends as other pictures do would become a folder's.
[[nodiscard]] inline CLI::Validator charts(bool file = true, bool page = false) {
    return CLI::Validator(
        [file, page](const std::string& input) {
            std::string ending = std::filesystem::path(input).extension().string();
            for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
            const auto is = [&](const char* other) { return ending == other; };
            constexpr std::array kOthers{".png", ".pdf", ".jpg", ".jpeg", ".gif", ".eps", ".ps"};
            const bool other = std::any_of(kOthers.begin(), kOthers.end(), is) ||
                               (is(".html") && !page) || (is(".svg") && !file);
            return other ? printable(input) + ": charts are SVG; expected " +
                               (file ? "a name that ends in .svg, or a folder" : "a folder")
                         : std::string();
        },
        "");
}

}  // namespace vibrig::proto
