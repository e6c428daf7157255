#include "proto/register_map.hpp"

#include <bit>
#include <cmath>
#include <limits>

namespace vibrig::proto {

namespace {

std::uint32_t join(const Register& reg, std::span<const std::uint16_t> words) noexcept {
    const std::uint32_t first = words[0];
    const std::uint32_t second = words[1];
    return reg.order == WordOrder::big ? (first << 16) | second : (second << 16) | first;
}

void split(const Register& reg, std::uint32_t raw, std::span<std::uint16_t> words) noexcept {
    const auto high = static_cast<std::uint16_t>(raw >> 16);
    const auto low = static_cast<std::uint16_t>(raw & 0xffffU);
    words[0] = reg.order == WordOrder::big ? high : low;
    words[1] = reg.order == WordOrder::big ? low : high;
}

// Every 16- and 32-bit integer is exact in a double, so the comparison is too.
template <typename Integer>
bool fits(double raw) noexcept {
    return raw >= static_cast<double>(std::numeric_limits<Integer>::min()) &&
           raw <= static_cast<double>(std::numeric_limits<Integer>::max());
}

bool encode_bits(const Register& reg, double value, std::span<std::uint16_t> words) noexcept {
    if (value != 0 && value != 1) return false;
    // The register's other bits belong to somebody else.
    const unsigned others = words[0] & ~static_cast<unsigned>(reg.mask) & 0xffffU;
    words[0] = static_cast<std::uint16_t>(value == 1 ? others | reg.mask : others);
    return true;
}

}  // namespace

std::size_t Register::words() const noexcept {
    using enum RegisterType;
    return type == u32 || type == i32 || type == f32 ? 2 : 1;
}

double decode(const Register& reg, std::span<const std::uint16_t> words) noexcept {
    if (words.size() < reg.words()) return std::numeric_limits<double>::quiet_NaN();
    switch (reg.type) {
        case RegisterType::u16:
            return words[0] * reg.scale;
        case RegisterType::i16:
            return std::bit_cast<std::int16_t>(words[0]) * reg.scale;
        case RegisterType::u32:
            return join(reg, words) * reg.scale;
        case RegisterType::i32:
            return std::bit_cast<std::int32_t>(join(reg, words)) * reg.scale;
        case RegisterType::f32:
            return static_cast<double>(std::bit_cast<float>(join(reg, words))) * reg.scale;
        case RegisterType::bits:
            return (words[0] & reg.mask) != 0 ? 1 : 0;
    }
    return std::numeric_limits<double>::quiet_NaN();
}

bool encode(const Register& reg, double value, std::span<std::uint16_t> words) noexcept {
    if (!std::isfinite(value) || words.size() < reg.words()) return false;
    if (reg.type == RegisterType::bits) return encode_bits(reg, value, words);
    const double quotient = value / reg.scale;
    if (reg.type == RegisterType::f32) {
        // Compared before the conversion: a double beyond float's range must not be converted.
        if (!(std::abs(quotient) <= static_cast<double>(std::numeric_limits<float>::max()))) {
            return false;
        }
        split(reg, std::bit_cast<std::uint32_t>(static_cast<float>(quotient)), words);
        return true;
    }
    const double raw = std::round(quotient);  // NaN from a scale of 0 fits no type
    switch (reg.type) {
        case RegisterType::u16:
            if (!fits<std::uint16_t>(raw)) return false;
            words[0] = static_cast<std::uint16_t>(raw);
            return true;
        case RegisterType::i16:
            if (!fits<std::int16_t>(raw)) return false;
            words[0] = std::bit_cast<std::uint16_t>(static_cast<std::int16_t>(raw));
            return true;
        case RegisterType::u32:
            if (!fits<std::uint32_t>(raw)) return false;
            split(reg, static_cast<std::uint32_t>(raw), words);
            return true;
        case RegisterType::i32:
            if (!fits<std::int32_t>(raw)) return false;
            split(reg, std::bit_cast<std::uint32_t>(static_cast<std::int32_t>(raw)), words);
            return true;
        case RegisterType::f32:
        case RegisterType::bits:
            break;
    }
    return false;
}

}  // namespace vibrig::proto
