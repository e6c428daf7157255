#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "drivers/sample/channels.hpp"
#include "proto/dbc.hpp"

namespace vibrig::drivers {

/// What one message means to the assembler, worked out beforehand from the bindings.
struct MessagePlan {
    struct ChannelSignal {
        std::size_t channel;
        const proto::Signal* signal;
        bool validity;           ///< it says whether the channel is valid, and carries no value
        std::uint32_t part = 0;  ///< sample of the frame, 0: the first
    };
    /// What a frame carries only when its multiplexor has these values.
    struct Group {
        std::uint32_t first = 0, last = 0;
        std::uint64_t bit = 0;
    };
    struct StatusSignal {
        const StatusRow* row;
        const proto::Signal* signal;
    };

    const proto::Message* message = nullptr;
    const proto::Signal* count = nullptr;  ///< the full sync count
    const proto::Signal* low = nullptr;    ///< low bits of it
    std::vector<ChannelSignal> channels;
    std::vector<StatusSignal> status;
    std::uint64_t bit = 0;  ///< of this message in a sample's set; 0: not part of samples
    const proto::Signal* multiplexor = nullptr;  ///< null: it has no groups
    std::vector<Group> groups;                   ///< of its channels

    /// In a sample's set, of a frame with this payload; 0: it is not part of samples.
    [[nodiscard]] std::uint64_t bits(std::span<const std::uint8_t> payload) const noexcept;
};

/// All plans, found by CAN id in constant time (standard ids) or by bisection (extended).
class FramePlan {
  public:
    /// `samples_per_frame`: signal S carries the first one's value, S_1, S_2, ... the others'.
    FramePlan(const proto::Dbc& dbc, const SignalBindings& bindings,
              std::uint32_t samples_per_frame = 1, bool units_checked = true);

    /// Null: nothing of this message is bound.
    [[nodiscard]] const MessagePlan* find(std::uint32_t id, bool extended) const noexcept;
    [[nodiscard]] bool bound(std::size_t channel) const noexcept { return bound_[channel]; }
    [[nodiscard]] bool has_validity(std::size_t channel) const noexcept {
        return has_validity_[channel];
    }
    /// The set of messages that make a sample complete.
    [[nodiscard]] std::uint64_t complete() const noexcept { return complete_; }
    [[nodiscard]] bool has_count() const noexcept { return has_count_; }

  private:
    MessagePlan& plan_for(const proto::Message& message);
    void number_messages(const SignalBindings& names);

    proto::Dbc dbc_;  // the plans point into it
    std::vector<MessagePlan> plans_;
    std::array<std::uint16_t, 2048> standard_{};                     // index + 1 by id
    std::vector<std::pair<std::uint32_t, std::uint16_t>> extended_;  // sorted by id
    std::array<bool, kChannels> bound_{};
    std::array<bool, kChannels> has_validity_{};
    std::uint64_t complete_ = 0;
    bool has_count_ = false;
};

}  // namespace vibrig::drivers
