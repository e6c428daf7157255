#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/serve/caller.hpp"
#include "daemon/status/source.hpp"

namespace vibrig::serve {

/// One status as all streams share it.
struct Frame;

/// Makes statuses and the differences between them, each once for however many clients. Server
/// thread only.
class StreamFeed {
  public:
    explicit StreamFeed(StatusSource& source) : source_(source) {}
    /// The status at `now`, or of a moment ago, or one made since `since` (the begin of the
    /// client's period) at most a fifth of a second ago: however many are due together, and however
    /// long it takes to serve them, one is made for all.
    [[nodiscard]] std::shared_ptr<const Frame> newest(std::chrono::steady_clock::time_point now,
                                                      std::chrono::steady_clock::time_point since);
    /// The text of the status now; one who commands sees what came of it after forget().
    [[nodiscard]] const std::string& newest_text();
    void forget() noexcept { newest_.reset(); }
    [[nodiscard]] StatusSource& source() noexcept { return source_; }
    /// {"type":"status","status":...} without a frame before, else {"type":"delta","patch":...}, a
    /// JSON merge patch (RFC 7396); empty: nothing changed.
    [[nodiscard]] std::shared_ptr<const std::string> change(
        const std::shared_ptr<const Frame>& before, const std::shared_ptr<const Frame>& after);

  private:
    struct Made {
        std::uint64_t from, to;
        std::shared_ptr<const std::string> text;
    };
    StatusSource& source_;
    std::shared_ptr<const Frame> newest_;
    std::uint64_t number_ = 0;
    std::deque<Made> made_;  ///< the newest few
};

/// What one client of the stream gets, in order, whatever its speed: of data the latest, of events
/// every one. Nothing waits in here: a slow client's next delta spans more.
class StreamClient {
  public:
    static constexpr std::size_t kMostEventsBehind = 500;
    static constexpr double kSlowest_hz = 0.1, kFastest_hz = 20;

    /// Events with an id above `after_event`; the newest ones if that is more than may wait.
    /// `with_status`: false for one who wants the events alone, looked for at the rate.
    StreamClient(StreamFeed& feed, std::string instance, Role role, double rate_hz,
                 std::uint64_t after_event, bool with_status = true);
    /// The next text to send; null: nothing yet. Throws std::runtime_error when too many events
    /// wait: the client is too slow and has to go.
    [[nodiscard]] std::shared_ptr<const std::string> next(
        std::chrono::steady_clock::time_point now);
    [[nodiscard]] std::chrono::steady_clock::time_point due() const noexcept { return due_; }
    /// {"rate_hz": 5}; throws std::invalid_argument.
    void take(const std::string& text);

  private:
    StreamFeed& feed_;
    std::string instance_;
    Role role_;
    std::chrono::steady_clock::duration period_{};
    std::chrono::steady_clock::time_point due_{};
    std::shared_ptr<const Frame> sent_;
    std::uint64_t event_ = 0;
    bool with_status_;
    bool greeted_ = false, caught_up_ = false, events_looked_at_ = false;
};

/// Throws std::invalid_argument; empty: the default.
[[nodiscard]] double parse_rate(std::string_view text);

}  // namespace vibrig::serve
