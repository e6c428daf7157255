#include "proto/dbc_check.hpp"

#include <bitset>
#include <limits>

namespace vibrig::proto {

namespace {

constexpr std::size_t kPayloadBits = 512;

struct Extent {
    std::bitset<kPayloadBits> bits;
    std::uint32_t first = 0;  ///< multiplex values for which the signal is present
    std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
};

/// Position of a big-endian signal's first bit counted from the left of the payload.
unsigned from_left(unsigned start_bit) noexcept { return start_bit / 8 * 8 + (7 - start_bit % 8); }

Extent extent_of(const Signal& signal) {
    Extent extent;
    const bool big = signal.order == ByteOrder::big;
    for (unsigned i = 0; i < signal.length; ++i) {
        const unsigned bit =
            big ? from_left(from_left(signal.start_bit) + i) : signal.start_bit + i;
        extent.bits.set(bit);
    }
    if (signal.multiplex_value) {
        extent.first = *signal.multiplex_value;
        extent.last = signal.multiplex_last.value_or(*signal.multiplex_value);
    }
    return extent;
}

void check_overlap(const Message& message, const std::vector<Position>& places,
                   const DbcScanner& scanner) {
    std::vector<Extent> extents;
    extents.reserve(message.signals.size());
    for (std::size_t i = 0; i < message.signals.size(); ++i) {
        const Extent extent = extent_of(message.signals[i]);
        for (std::size_t k = 0; k < i; ++k) {
            const Extent& other = extents[k];
            if (extent.first > other.last || other.first > extent.last) continue;
            if ((extent.bits & other.bits).none()) continue;
            scanner.fail_at(places[i], "found signal '" + message.signals[i].name +
                                           "' overlapping signal '" + message.signals[k].name +
                                           "', expected bits of its own");
        }
        extents.push_back(extent);
    }
}

void check_multiplexing(const Message& message, const std::vector<Position>& places,
                        const DbcScanner& scanner) {
    const Signal* multiplexor = message.multiplexor();
    for (std::size_t i = 0; i < message.signals.size(); ++i) {
        const Signal& signal = message.signals[i];
        if (signal.is_multiplexor && signal.type != ValueType::integer) {
            scanner.fail_at(places[i], "found multiplexor '" + signal.name +
                                           "' of floating type, expected an integer");
        }
        if (!signal.multiplex_value) continue;
        if (multiplexor == nullptr) {
            scanner.fail_at(places[i], "found multiplexed signal '" + signal.name +
                                           "', expected a multiplexor (M) in message '" +
                                           message.name + "'");
        }
        const std::uint32_t last = signal.multiplex_last.value_or(*signal.multiplex_value);
        if (multiplexor->length < 32 && (last >> multiplexor->length) != 0) {
            scanner.fail_at(places[i], "found multiplex value " + std::to_string(last) +
                                           ", expected one that the " +
                                           std::to_string(multiplexor->length) + " bits of '" +
                                           multiplexor->name + "' hold");
        }
    }
}

}  // namespace

bool fits_message(const Signal& signal, unsigned size) noexcept {
    const unsigned first =
        signal.order == ByteOrder::big ? from_left(signal.start_bit) : signal.start_bit;
    return first + signal.length <= size * 8;
}

void check_message(const Message& message, const std::vector<Position>& places,
                   const DbcScanner& scanner) {
    check_multiplexing(message, places, scanner);
    check_overlap(message, places, scanner);
}

}  // namespace vibrig::proto
