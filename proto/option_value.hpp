#pragma once

#include <CLI/Validators.hpp>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <system_error>

namespace vibrig::proto {

inline constexpr double kAboveZero = std::numeric_limits<double>::min();
inline constexpr double kAnyLow = -std::numeric_limits<double>::max();
inline constexpr double kAnyHigh = std::numeric_limits<double>::max();

// What options of both programs, vibrig and vibrig-plant, may be given.

/// A finite number from `low` to `high`; of a list, each element. CLI11's own checks let NaN pass.
[[nodiscard]] inline CLI::Validator finite(double low = kAnyLow, double high = kAnyHigh) {
    const auto words = [](const char* format, double value) {
        std::array<char, 40> out{};
        std::snprintf(out.data(), out.size(), format, value);
        return std::string(out.data());
    };
    std::string expected = "a finite number";
    if (low > kAnyLow) expected += low == kAboveZero ? " above 0" : words(" from %g", low);
    if (high < kAnyHigh) expected += words(" up to %g", high);
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
            const char* end = input.data() + input.size();
            const auto [rest, error] = std::from_chars(input.data(), end, value);
            return error == std::errc() && rest == end && !input.empty()
                       ? std::string()
                       : "found " + input + ", expected a whole number from 0";
        },
        "");
}

}  // namespace vibrig::proto
