#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "drivers/base/clock.hpp"

namespace vibrig::commission {

/// What is on a bus of which nobody has a DBC: messages, how often they come, and which of their
/// bytes change, at rest and while somebody turns a gimbal. One thread.
class BusList {
  public:
    /// From now on it is turned.
    void turned() noexcept { turned_ = true; }
    /// Times grow; of an extended identifier `extended`.
    void add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data,
             drivers::Time time);

    struct Message {
        std::uint32_t id = 0;
        bool extended = false;
        std::uint64_t frames = 0;
        double period_ms = 0, jitter_ms = 0;    ///< mean and standard deviation; 0: one frame only
        std::size_t shortest = 0, longest = 0;  ///< bytes
        std::vector<int> at_rest;               ///< bytes that change then
        std::vector<int> turned_only;           ///< that change while it is turned, and not at rest
        std::vector<int> counters;              ///< that grow by one with each frame, at rest
        /// For each byte that changes: in which share of frames, at rest and while it is turned. Of
        /// an angle the highest byte flips least.
        struct Flips {
            int byte = 0;
            double at_rest = 0, turned = 0;
        };
        std::vector<Flips> flips;
    };
    [[nodiscard]] std::vector<Message> messages() const;
    [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }

  private:
    struct Seen {
        Message message;
        drivers::Time first = 0, last = 0;
        double mean_s = 0, squares = 0;  ///< of the intervals, Welford
        std::array<std::uint8_t, 64> before{};
        std::array<std::uint64_t, 64> rest{}, turn{};  ///< frames that changed a byte
        std::uint64_t rested = 0, turned = 0;          ///< frames that could
        std::array<bool, 64> counts{};
    };
    std::map<std::pair<bool, std::uint32_t>, Seen> seen_;
    std::uint64_t frames_ = 0;
    bool turned_ = false;
};

/// A line per message, with a heading; fits 80 columns unless many bytes change.
[[nodiscard]] std::string table_of(const BusList& bus);
[[nodiscard]] nlohmann::ordered_json json_of(const BusList& bus);

}  // namespace vibrig::commission
