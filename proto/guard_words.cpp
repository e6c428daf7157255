#include "proto/guard_words.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "proto/word_of.hpp"

namespace vibrig::proto {

namespace {

// "VbD2", "VbG2": kind and version.
constexpr std::uint32_t kDaemonKind = 0x32446256;
constexpr std::uint32_t kGuardKind = 0x32476256;

/// Little endian, one field after the other.
class WordWriter {
  public:
    explicit WordWriter(std::span<std::uint8_t> bytes) : bytes_(bytes) {}
    void put(std::uint64_t value, std::size_t size) noexcept {
        for (std::size_t i = 0; i < size; ++i)
            bytes_[at_++] = static_cast<std::uint8_t>(value >> (8 * i));
    }
    void put(double value) noexcept { put(std::bit_cast<std::uint64_t>(value), 8); }

  private:
    std::span<std::uint8_t> bytes_;
    std::size_t at_ = 0;
};

class WordReader {
  public:
    explicit WordReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
    std::uint64_t get(std::size_t size) noexcept {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < size; ++i) value |= std::uint64_t{bytes_[at_++]} << (8 * i);
        return value;
    }
    double number() noexcept { return std::bit_cast<double>(get(8)); }

  private:
    std::span<const std::uint8_t> bytes_;
    std::size_t at_ = 0;
};

[[nodiscard]] bool is_level(double level_g) noexcept {
    return std::isfinite(level_g) && level_g >= 0;
}

}  // namespace

const char* name_of(GuardCause cause) noexcept {
    static constexpr std::array kWords{"none",           "daemon_silent", "daemon_hangs",
                                       "unarmed_motion", "over_level",    "stop_disobeyed"};
    return word_of(kWords, cause);
}

const char* text_of(GuardCause cause) noexcept {
    static constexpr std::array kWords{
        "nothing found",
        "vibrigd is silent while the table moves",
        "a stage of vibrigd hangs while the table moves",
        "the table moves and nothing that somebody has armed excites it",
        "the table moves by more than what was armed",
        "a stop was ordered and the table is not at rest: press the emergency stop"};
    return word_of(kWords, cause);
}

std::array<std::uint8_t, kDaemonWordBytes> encode(const DaemonWord& word) noexcept {
    std::array<std::uint8_t, kDaemonWordBytes> bytes{};
    WordWriter to(bytes);
    to.put(kDaemonKind, 4);
    to.put((word.armed ? 1U : 0U) | (word.excitation ? 2U : 0U) | (word.stop_ordered ? 4U : 0U), 4);
    to.put(word.sequence, 8);
    for (const auto progress : word.progress) to.put(progress, 8);
    to.put(word.level_g);
    to.put(word.acknowledged, 8);
    to.put(word.platform_ratio);
    return bytes;
}

std::array<std::uint8_t, kGuardWordBytes> encode(const GuardWord& word) noexcept {
    std::array<std::uint8_t, kGuardWordBytes> bytes{};
    WordWriter to(bytes);
    to.put(kGuardKind, 4);
    to.put((word.disobeyed ? 1U : 0U) | (word.sees ? 2U : 0U) | (word.rest ? 4U : 0U) |
               (word.reaches_shaker ? 8U : 0U) | (word.horn_confirms ? 16U : 0U),
           2);
    to.put(static_cast<std::uint64_t>(word.cause), 2);
    to.put(word.sequence, 8);
    to.put(word.finding, 8);
    to.put(word.table_g);
    for (const char c : word.version) to.put(static_cast<unsigned char>(c), 1);
    return bytes;
}

std::optional<DaemonWord> decode_daemon_word(std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.size() != kDaemonWordBytes) return {};
    WordReader from(bytes);
    if (from.get(4) != kDaemonKind) return {};
    const auto flags = from.get(4);
    DaemonWord word;
    word.armed = (flags & 1U) != 0;
    word.excitation = (flags & 2U) != 0;
    word.stop_ordered = (flags & 4U) != 0;
    word.sequence = from.get(8);
    for (auto& progress : word.progress) progress = from.get(8);
    word.level_g = from.number();
    word.acknowledged = from.get(8);
    word.platform_ratio = from.number();
    if (flags > 7 || !is_level(word.level_g)) return {};
    if (!(word.platform_ratio >= 1 && word.platform_ratio <= 1000)) return {};
    return word;
}

std::optional<GuardWord> decode_guard_word(std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.size() != kGuardWordBytes) return {};
    WordReader from(bytes);
    if (from.get(4) != kGuardKind) return {};
    const auto flags = from.get(2);
    const auto cause = from.get(2);
    GuardWord word;
    word.disobeyed = (flags & 1U) != 0;
    word.sees = (flags & 2U) != 0;
    word.rest = (flags & 4U) != 0;
    word.reaches_shaker = (flags & 8U) != 0;
    word.horn_confirms = (flags & 16U) != 0;
    word.cause = static_cast<GuardCause>(cause);
    word.sequence = from.get(8);
    word.finding = from.get(8);
    word.table_g = from.number();
    for (char& c : word.version) c = static_cast<char>(from.get(1));
    const auto no_text = [](char c) { return c != 0 && (c < ' ' || c > '~'); };
    if (std::ranges::any_of(word.version, no_text) || word.version.back() != 0) return {};
    if (flags > 31 || cause > static_cast<std::uint64_t>(GuardCause::stop_disobeyed) ||
        !is_level(word.table_g))
        return {};
    return word;
}

}  // namespace vibrig::proto
