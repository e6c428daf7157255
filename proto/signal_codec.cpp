#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "proto/dbc.hpp"

namespace vibrig::proto {

namespace {

/// Walks a signal's bits from the least significant one, a part of a byte at a time (9 parts at
/// most). Little endian goes up through the bytes; big endian goes down, and its start bit is the
/// most significant one, with bits numbered 7..0 from the left inside each byte.
class BitWalk {
  public:
    explicit BitWalk(const Signal& signal) noexcept
        : up_(signal.order == ByteOrder::little), left_(signal.length) {
        if (up_) {
            byte_ = signal.start_bit / 8U;
            bit_ = signal.start_bit % 8U;
            last_byte_ = (signal.start_bit + signal.length - 1U) / 8U;
        } else {
            const unsigned from_left = signal.start_bit / 8U * 8U + (7U - signal.start_bit % 8U);
            const unsigned lsb = from_left + signal.length - 1U;
            byte_ = lsb / 8U;
            bit_ = 7U - lsb % 8U;
            last_byte_ = byte_;
        }
    }

    [[nodiscard]] std::size_t last_byte() const noexcept { return last_byte_; }
    [[nodiscard]] bool more() const noexcept { return left_ > 0; }
    [[nodiscard]] std::size_t byte() const noexcept { return byte_; }
    [[nodiscard]] unsigned shift() const noexcept { return bit_; }
    [[nodiscard]] unsigned count() const noexcept { return std::min(8U - bit_, left_); }
    [[nodiscard]] unsigned mask() const noexcept { return (1U << count()) - 1U; }
    void advance() noexcept {
        left_ -= count();
        bit_ = 0;
        byte_ = up_ ? byte_ + 1 : byte_ - 1;
    }

  private:
    bool up_;
    unsigned left_;
    unsigned byte_ = 0;
    unsigned bit_ = 0;
    unsigned last_byte_ = 0;
};

bool usable(const Signal& signal, const BitWalk& walk, std::size_t payload_size) noexcept {
    return signal.length >= 1 && signal.length <= 64 && walk.last_byte() < payload_size;
}

std::optional<std::uint64_t> decode_bits(const Signal& signal,
                                         std::span<const std::uint8_t> payload) noexcept {
    BitWalk walk(signal);
    if (!usable(signal, walk, payload.size())) return std::nullopt;
    std::uint64_t raw = 0;
    for (unsigned done = 0; walk.more(); walk.advance()) {
        const unsigned byte = payload[walk.byte()];
        const std::uint64_t part = (byte >> walk.shift()) & walk.mask();
        raw |= part << done;
        done += walk.count();
    }
    return raw;
}

std::int64_t sign_extend(std::uint64_t raw, unsigned length) noexcept {
    const unsigned unused = 64U - length;
    return std::bit_cast<std::int64_t>(raw << unused) >> unused;
}

/// The nearest integer as a bit pattern, limited to what `length` bits hold.
std::uint64_t clamp_integer(double value, unsigned length, bool is_signed) noexcept {
    const unsigned unused = 64U - length;
    if (!is_signed) {
        const std::uint64_t maximum = std::numeric_limits<std::uint64_t>::max() >> unused;
        if (value <= 0) return 0;
        // 2^length, exact in a double while `maximum` of 64 bits is not.
        if (value >= std::ldexp(1.0, static_cast<int>(length))) return maximum;
        return std::min(static_cast<std::uint64_t>(value), maximum);
    }
    const std::int64_t maximum = std::numeric_limits<std::int64_t>::max() >> unused;
    const std::int64_t minimum = std::numeric_limits<std::int64_t>::min() >> unused;
    const double limit = std::ldexp(1.0, static_cast<int>(length) - 1);
    if (value >= limit) return std::bit_cast<std::uint64_t>(maximum);
    if (value <= -limit) return std::bit_cast<std::uint64_t>(minimum);
    return std::bit_cast<std::uint64_t>(static_cast<std::int64_t>(value));
}

}  // namespace

std::optional<std::int64_t> decode_raw(const Signal& signal,
                                       std::span<const std::uint8_t> payload) noexcept {
    const auto raw = decode_bits(signal, payload);
    if (!raw) return std::nullopt;
    if (signal.is_signed) return sign_extend(*raw, signal.length);
    return std::bit_cast<std::int64_t>(*raw);
}

std::optional<double> decode(const Signal& signal, std::span<const std::uint8_t> payload) noexcept {
    const auto raw = decode_bits(signal, payload);
    if (!raw) return std::nullopt;
    double value = 0;
    if (signal.type == ValueType::float32) {
        value = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(*raw)));
    } else if (signal.type == ValueType::float64) {
        value = std::bit_cast<double>(*raw);
    } else if (signal.is_signed) {
        value = static_cast<double>(sign_extend(*raw, signal.length));
    } else {
        value = static_cast<double>(*raw);
    }
    return value * signal.scale + signal.offset;
}

bool encode(const Signal& signal, double value, std::span<std::uint8_t> payload) noexcept {
    if (!std::isfinite(value)) return false;
    const double number = (value - signal.offset) / signal.scale;
    if (std::isnan(number)) return false;
    if (signal.type == ValueType::float32) {
        constexpr double kMaximum = std::numeric_limits<float>::max();
        const auto single = static_cast<float>(std::clamp(number, -kMaximum, kMaximum));
        return encode_raw(signal, std::bit_cast<std::uint32_t>(single), payload);
    }
    if (signal.type == ValueType::float64) {
        constexpr double kMaximum = std::numeric_limits<double>::max();
        const double limited = std::clamp(number, -kMaximum, kMaximum);
        return encode_raw(signal, std::bit_cast<std::uint64_t>(limited), payload);
    }
    if (signal.length < 1 || signal.length > 64) return false;
    return encode_raw(signal, clamp_integer(std::round(number), signal.length, signal.is_signed),
                      payload);
}

bool encode_raw(const Signal& signal, std::uint64_t raw, std::span<std::uint8_t> payload) noexcept {
    BitWalk walk(signal);
    if (!usable(signal, walk, payload.size())) return false;
    for (; walk.more(); walk.advance()) {
        const unsigned part = static_cast<unsigned>(raw & walk.mask()) << walk.shift();
        const unsigned byte = payload[walk.byte()];
        const unsigned kept = byte & ~(walk.mask() << walk.shift());
        payload[walk.byte()] = static_cast<std::uint8_t>(kept | part);
        raw >>= walk.count();
    }
    return true;
}

bool present(const Message& message, const Signal& signal,
             std::span<const std::uint8_t> payload) noexcept {
    if (!signal.multiplex_value) return true;
    const Signal* multiplexor = message.multiplexor();
    if (multiplexor == nullptr) return false;
    const auto raw = decode_bits(*multiplexor, payload);
    return raw && *raw >= *signal.multiplex_value &&
           *raw <= signal.multiplex_last.value_or(*signal.multiplex_value);
}

bool out_of_range(const Signal& signal, double value) noexcept {
    if (!std::isfinite(value)) return true;
    return signal.minimum < signal.maximum && (value < signal.minimum || value > signal.maximum);
}

}  // namespace vibrig::proto
