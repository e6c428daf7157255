// What a campaign's file may say of itself, whoever wrote it.
#pragma once

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "daemon/record/campaign_columns.hpp"
#include "daemon/record/hdf5.hpp"
#include "drivers/sample/sample.hpp"
#include "proto/text.hpp"

namespace vibrig::record {

/// Sums and differences of any two of them fit into 64 bits: 36 years of the daemon's clock, and
/// UTC until 2116, which the clock of a log by itself may be.
inline constexpr drivers::Time kMostTime = drivers::Time{1} << 60,
                               kMostUtc = drivers::Time{1} << 62;

/// Of a dwell: twice what a configuration may order.
inline constexpr drivers::Time kLongestDwell = 2 * 86'400 * drivers::kSecond;

/// A text that is printed sooner or later, on terminals too.
[[nodiscard]] inline std::string shown(std::string_view text) {
    return proto::printable(text, proto::kLongestLine);
}

/// Of a column of whole numbers: those that its field can hold, `width` in a row. Flags and words
/// are taken as they are meant.
template <typename Number>
void check_numbers(const hdf5::File& file, const std::string& group, std::string_view column,
                   std::span<const std::int64_t> found, std::size_t width) {
    if constexpr (!std::is_enum_v<Number> && !std::same_as<Number, bool>) {
        const drivers::Time time = column == "utc_ns" ? kMostUtc : kMostTime;
        const auto wrong = std::ranges::find_if(found, [time](std::int64_t number) {
            return std::same_as<Number, drivers::Time> ? number < -time || number > time
                                                       : !std::in_range<Number>(number);
        });
        if (wrong != found.end())
            throw hdf5::Error(fmt::format(
                "{}: {}/{}: row {}: found {}, expected a {}", file.path(), group, column,
                static_cast<std::size_t>(wrong - found.begin()) / width + 1, *wrong,
                std::same_as<Number, drivers::Time> ? "time" : "number that fits its column"));
    }
}

/// An attribute of the file.
template <typename Number>
Number checked_number(const hdf5::File& file, const char* name) {
    const std::int64_t number = file.number("/", name);
    if constexpr (std::same_as<Number, bool>) {
        return number != 0;
    } else {
        const bool fits = std::same_as<Number, drivers::Time>
                              ? number >= -kMostTime && number <= kMostUtc
                              : std::in_range<Number>(number);
        if (!fits)
            throw hdf5::Error(fmt::format(
                "{}: attribute {}: found {}, expected a {}", file.path(), name, number,
                std::same_as<Number, drivers::Time> ? "time" : "number that it can be"));
        return static_cast<Number>(number);
    }
}

/// A visitor: what a dwell is identified with is a number; when it began may be unknown.
struct Finite {
    const hdf5::File& file;
    std::string_view group;
    std::size_t row;

    void operator()(const char* name, const auto& field, const auto&...) const {
        if constexpr (std::floating_point<typename decltype(numbers_in(field))::value_type>) {
            for (const double number : numbers_in(field))
                if (!std::isfinite(number) && std::string_view(name) != "begin_s")
                    throw hdf5::Error(
                        fmt::format("{}: {}/{}: row {}: found {}, expected a finite number",
                                    file.path(), group, name, row + 1, number));
        }
    }
    void newer(const auto&... column) const { (*this)(column...); }
};

}  // namespace vibrig::record
