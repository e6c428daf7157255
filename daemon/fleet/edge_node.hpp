#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/status/values.hpp"

namespace vibrig::fleet {

/// The rig as an edge node of Sparkplug B: its payloads, from the status. What goes with them is
/// the publisher's. One thread.
class EdgeNode {
  public:
    /// Before each connection: the death announced with it belongs to the birth that follows.
    void next_session();
    /// For the broker to publish when the connection is lost.
    [[nodiscard]] std::string death(std::int64_t utc_ns) const;
    /// All metrics with name, type, unit and alias; what is not known now is null.
    [[nodiscard]] std::string birth(const StatusData& status);
    /// What has changed since the payload before, by alias; empty: nothing has.
    [[nodiscard]] std::string data(const StatusData& status);

    /// Whether this payload of a command asks for a birth. The only command there is: a broker
    /// cannot move the rig. Bytes that are no payload ask for nothing.
    [[nodiscard]] static bool asks_for_birth(std::string_view payload);

  private:
    std::uint64_t session_ = 255;  ///< bdSeq, 0 to 255
    std::uint64_t sequence_ = 0;   ///< of the next payload, 0 to 255
    std::vector<StatusScalar> published_;
};

}  // namespace vibrig::fleet
