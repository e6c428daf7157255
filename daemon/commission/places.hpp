#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "proto/register_map.hpp"

namespace vibrig::commission {

/// Registers of one table as they were read, from address 0 on; nothing: they cannot be read.
struct RegisterBlock {
    proto::RegisterTable table = proto::RegisterTable::holding;
    std::vector<std::optional<std::uint16_t>> words;
};

/// What a display shows, with as many digits as it shows.
struct Shown {
    double value = 0;
    double half_digit = 0;  ///< what the display leaves open
};
/// Nothing: no number of digits and a point.
[[nodiscard]] std::optional<Shown> shown_number(const std::string& text);
/// Nothing: no positive number.
[[nodiscard]] std::optional<Shown> shown_value(const std::string& text);

/// Where the value may be kept, in any type, either word order and a scale of 1e-6 to 1e3. Of
/// types of one word the order is big.
[[nodiscard]] std::vector<proto::Register> places_of(const Shown& shown,
                                                     const std::vector<RegisterBlock>& blocks);
/// Those of `places` that keep this value, too.
[[nodiscard]] std::vector<proto::Register> still_places(const std::vector<proto::Register>& places,
                                                        const Shown& shown,
                                                        const std::vector<RegisterBlock>& blocks);

/// A line of [shaker.registers].
[[nodiscard]] std::string toml_line(const std::string& role, const proto::Register& place);

}  // namespace vibrig::commission
