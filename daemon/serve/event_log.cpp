#include "daemon/serve/event_log.hpp"

#include <algorithm>
#include <utility>

namespace vibrig::serve {

EventLog::EventLog(std::size_t capacity) : capacity_(std::max<std::size_t>(capacity, 1)) {}

std::uint64_t EventLog::append(EventRecord event) {
    const std::lock_guard lock(mutex_);
    event.id = ++newest_id_;
    if (events_.size() == capacity_) events_.pop_front();
    events_.push_back(std::move(event));
    return newest_id_;
}

std::vector<EventRecord> EventLog::after(std::uint64_t after_id, std::size_t at_most) const {
    const std::lock_guard lock(mutex_);
    // Ids are consecutive, so the place of the first wanted event follows from the oldest one's id.
    const std::uint64_t oldest = newest_id_ - events_.size() + 1;
    const std::uint64_t skip = after_id < oldest ? 0 : after_id - oldest + 1;
    if (skip >= events_.size()) return {};
    const auto first = events_.begin() + static_cast<std::ptrdiff_t>(skip);
    const auto count = std::min<std::size_t>(events_.size() - skip, at_most);
    return {first, first + static_cast<std::ptrdiff_t>(count)};
}

}  // namespace vibrig::serve
