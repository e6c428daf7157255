#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace vibrig::proto {

/// What the guard found; the first cause stays until it is acknowledged.
enum class GuardCause : std::uint8_t {
    none,
    daemon_silent,   ///< no word from the daemon while the table moves or may move
    daemon_hangs,    ///< words come, but one of its stages makes no progress
    unarmed_motion,  ///< the table moves, and nothing that was armed excites it
    over_level,      ///< more than the armed level
    stop_disobeyed,  ///< a stop was ordered in time and the table is not at rest
};
[[nodiscard]] const char* name_of(GuardCause cause) noexcept;
/// For people: what happened, and what to do where something is to be done at once.
[[nodiscard]] const char* text_of(GuardCause cause) noexcept;

/// What the daemon tells the guard, one packet each, several times a second.
struct DaemonWord {
    std::uint64_t sequence = 0;
    /// Of acquisition, estimator, control and shaker link: each lives as long as its number
    /// changes.
    std::array<std::uint64_t, 4> progress{};
    bool armed = false;         ///< a named person armed it
    bool excitation = false;    ///< from the ramp to rest
    bool stop_ordered = false;  ///< a stop that is not confirmed yet
    double level_g = 0;         ///< highest level of the arming, peak at the table; 0: not armed
    std::uint64_t acknowledged = 0;  ///< number of the guard's finding that a person acknowledged
    /// So many times more than by the reference frequency's transmission the platform may show of
    /// that level: a plan's other vibration may get through better.
    double platform_ratio = 1;
    bool operator==(const DaemonWord&) const = default;
};

/// What the guard answers.
struct GuardWord {
    std::uint64_t sequence = 0;  ///< of the word it answers; 0: it has heard none
    GuardCause cause = GuardCause::none;
    std::uint64_t finding = 0;       ///< number of the finding; 0: none since its start
    bool disobeyed = false;          ///< horn: press the emergency stop
    bool sees = false;               ///< a witness is known
    bool rest = false;               ///< all witnesses are at rest
    bool reaches_shaker = false;     ///< its own Modbus connection answers
    bool horn_confirms = true;       ///< false: horn or lamp do not read back as commanded
    double table_g = 0;              ///< largest peak at the table that a witness shows
    std::array<char, 16> version{};  ///< of its program, "1.2.3", the rest zeros
    bool operator==(const GuardWord&) const = default;
};

inline constexpr std::size_t kDaemonWordBytes = 72;
inline constexpr std::size_t kGuardWordBytes = 48;

[[nodiscard]] std::array<std::uint8_t, kDaemonWordBytes> encode(const DaemonWord& word) noexcept;
[[nodiscard]] std::array<std::uint8_t, kGuardWordBytes> encode(const GuardWord& word) noexcept;
/// Nothing for a packet of another length, kind or version, for flags that do not exist and for a
/// level that is not finite or below 0, a ratio that is not 1 to 1000, or a version that is no
/// text.
[[nodiscard]] std::optional<DaemonWord> decode_daemon_word(
    std::span<const std::uint8_t> bytes) noexcept;
[[nodiscard]] std::optional<GuardWord> decode_guard_word(
    std::span<const std::uint8_t> bytes) noexcept;

}  // namespace vibrig::proto
