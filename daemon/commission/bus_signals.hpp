#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/dbc.hpp"

namespace vibrig::commission {

/// Which signal of a DBC follows while a person turns one gimbal: range while turned over noise at
/// rest. Accelerometers answer, too; they are recognised as three whose norm stays. One thread.
class BusSignals {
  public:
    explicit BusSignals(proto::Dbc dbc);

    /// From now on one gimbal is turned.
    void turned() noexcept { turned_ = true; }
    void add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data);

    enum class Kind : std::uint8_t { value, accelerometer, counter, bit };
    struct Signal {
        std::string name, unit;  ///< "Message.Signal"
        Kind kind = Kind::value;
        double low = 0, high = 0;  ///< at rest
        double noise = 0;          ///< 1 sigma at rest, half a count at least
        double turned_range = 0;   ///< highest less lowest while turned, over its wraps
        bool changed = false;      ///< ever
        [[nodiscard]] double score() const { return turned_range / noise; }
    };
    /// Signals of the messages that were heard.
    [[nodiscard]] std::vector<Signal> signals() const;
    /// Messages of the DBC that were not heard; "1a0" that are not in it.
    [[nodiscard]] std::vector<std::string> missing() const;
    [[nodiscard]] std::vector<std::string> unknown() const;
    /// Values that answered the turn, best first; the first is the one if it beats the second by
    /// kBeats, or is alone.
    [[nodiscard]] std::vector<Signal> answers() const;
    [[nodiscard]] std::optional<std::string> winner() const;

    static constexpr double kBeats = 10, kAnswers = 10;

  private:
    struct Seen {
        const proto::Message* message = nullptr;
        const proto::Signal* signal = nullptr;
        bool heard = false, changed = false;
        double value = 0, wraps = 0;  ///< newest; added so that it goes on
        double low = 0, high = 0, turn_low = 0, turn_high = 0;
        std::int64_t before = 0;           ///< raw
        std::optional<std::int64_t> step;  ///< of each frame, raw, if it is always the same
        bool steps = true;
        double squares = 0;  ///< of first differences at rest
        std::size_t rest = 0, turn = 0;
    };
    void follow(Seen& seen, std::span<const std::uint8_t> data);
    [[nodiscard]] std::vector<std::array<std::size_t, 3>> of_constant_norm() const;
    [[nodiscard]] Signal describe(const Seen& seen) const;

    proto::Dbc dbc_;
    std::vector<Seen> seen_;
    std::map<std::pair<bool, std::uint32_t>, std::vector<std::size_t>> of_id_;
    std::map<std::pair<bool, std::uint32_t>, bool> strangers_;
    std::vector<std::vector<double>> rows_;  ///< while turned: of all signals, each a frame
    bool turned_ = false;
};

[[nodiscard]] const char* name_of(BusSignals::Kind kind) noexcept;
[[nodiscard]] std::string table_of(const BusSignals& bus, bool turned);
[[nodiscard]] nlohmann::ordered_json json_of(const BusSignals& bus, bool turned);

}  // namespace vibrig::commission
