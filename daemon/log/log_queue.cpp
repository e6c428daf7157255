#include "daemon/log/log_queue.hpp"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <string_view>
#include <utility>

namespace vibrig::log {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kBlocked = std::chrono::seconds(1);

bool write_line(int descriptor, std::string_view text) {
    while (!text.empty()) {
        const ssize_t n = ::write(descriptor, text.data(), text.size());
        if (n >= 0) {
            text.remove_prefix(static_cast<std::size_t>(n));
        } else if (errno == EAGAIN) {
            // Somebody who shares the terminal made it non-blocking.
            pollfd wait{descriptor, POLLOUT, 0};
            ::poll(&wait, 1, -1);
        } else if (errno != EINTR) {
            return false;
        }
    }
    return true;
}

}  // namespace

struct LogQueue::State {
    State(int to, std::size_t most)
        : descriptor(to), most_waiting(std::max<std::size_t>(most, 1)) {}

    const int descriptor;
    const std::size_t most_waiting;
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<std::string> lines;
    Counts counts;
    std::uint64_t unreported = 0;  ///< dropped since the last line that was written
    bool writing = false, ending = false;
    Clock::time_point since{};  ///< of the present write

    [[nodiscard]] std::uint64_t waiting() const { return lines.size() + (writing ? 1 : 0); }
};

LogQueue::LogQueue(int descriptor, std::size_t most_waiting)
    : state_(std::make_shared<State>(descriptor, most_waiting)),
      thread_([state = state_] { write_all(state); }) {
    ::pthread_setname_np(thread_.native_handle(), "log");
}

LogQueue::~LogQueue() {
    if (thread_.joinable()) end(std::chrono::milliseconds(0));
}

void LogQueue::put(std::string line) {
    const std::lock_guard lock(state_->mutex);
    ++state_->counts.taken;
    if (state_->lines.size() >= state_->most_waiting) {
        // The newest lines say most about why nobody reads them.
        state_->lines.pop_front();
        ++state_->counts.dropped;
        ++state_->unreported;
    }
    state_->lines.push_back(std::move(line));
    state_->changed.notify_all();
}

void LogQueue::write_all(const std::shared_ptr<State>& state) {
    std::unique_lock lock(state->mutex);
    for (;;) {
        state->changed.wait(lock, [&] { return state->ending || !state->lines.empty(); });
        if (state->lines.empty()) return;
        std::string line = std::move(state->lines.front());
        state->lines.pop_front();
        const std::uint64_t lost = std::exchange(state->unreported, 0);
        state->writing = true;
        state->since = Clock::now();
        lock.unlock();
        if (lost > 0)
            write_line(state->descriptor, "(" + std::to_string(lost) + " lines lost here)\n");
        const bool written = write_line(state->descriptor, line);
        lock.lock();
        state->writing = false;
        ++(written ? state->counts.written : state->counts.dropped);
        state->changed.notify_all();
    }
}

Counts LogQueue::counts() const {
    const std::lock_guard lock(state_->mutex);
    Counts counts = state_->counts;
    counts.waiting = state_->waiting();
    counts.blocked = state_->writing && Clock::now() - state_->since > kBlocked;
    return counts;
}

bool LogQueue::end(std::chrono::milliseconds patience) {
    bool all = false;
    {
        std::unique_lock lock(state_->mutex);
        state_->ending = true;
        state_->changed.notify_all();
        all = state_->changed.wait_for(lock, patience, [this] { return state_->waiting() == 0; });
        // What is given up is not written later, to whatever has the descriptor's number then.
        state_->counts.dropped += state_->lines.size();
        state_->lines.clear();
    }
    if (!thread_.joinable()) return all;
    all ? thread_.join() : thread_.detach();
    return all;
}

}  // namespace vibrig::log
