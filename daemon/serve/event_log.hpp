#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <vector>

#include "daemon/domain/events.hpp"

namespace vibrig::serve {

/// The newest events, bounded. Any thread; not for real-time ones, since it locks and allocates.
class EventLog {
  public:
    static constexpr std::size_t kCapacity = 10'000;

    explicit EventLog(std::size_t capacity = kCapacity);
    /// Gives the event the next id, from 1, and returns it. When full, the oldest event goes.
    std::uint64_t append(EventRecord event);
    /// The oldest `at_most` events with an id above `after_id`, oldest first.
    [[nodiscard]] std::vector<EventRecord> after(std::uint64_t after_id, std::size_t at_most) const;

  private:
    const std::size_t capacity_;
    mutable std::mutex mutex_;
    std::deque<EventRecord> events_;
    std::uint64_t newest_id_ = 0;
};

}  // namespace vibrig::serve
