#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/domain/events.hpp"
#include "daemon/rt/ring.hpp"
#include "drivers/sample/sample.hpp"

namespace vibrig::record {

/// What led to a trip: keeps the samples of the last minute and, when there is a trip, saves them
/// with the events of that minute. JSON lines: the cause first, then events, then samples. On a
/// thread of its own with memory taken at the beginning; nobody waits for it.
class PreTrip {
  public:
    static constexpr drivers::Time kSpan = 60 * drivers::kSecond;

    struct Cause {
        std::string condition, name, text;  ///< as in the interlock's table; in words
        drivers::Time time = 0;             ///< of the daemon's clock
        std::int64_t utc_ns = 0;
    };
    using Events = std::function<std::vector<EventRecord>()>;  ///< the newest, oldest first

    /// Files go to `folder`, which is made when the first one does.
    PreTrip(std::string folder, drivers::Time sample_period, Events events, EventSink tell);
    ~PreTrip();

    /// The acquisition thread pushes what its interlock has judged.
    [[nodiscard]] rt::Ring<drivers::Sample>& samples() noexcept { return ring_; }
    void start();
    void stop() noexcept;  ///< saves what was asked for and ends the thread
    void tripped(Cause cause);

  private:
    void loop();
    void take();
    void take_until(drivers::Time time);
    void save(const Cause& cause);
    /// Throws std::runtime_error.
    std::size_t write(const Cause& cause, const std::string& path) const;

    const std::string folder_;
    Events events_;
    EventSink tell_;
    rt::Ring<drivers::Sample> ring_{8192};
    std::vector<drivers::Sample> kept_;  ///< circular
    std::size_t next_ = 0, filled_ = 0;

    std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Cause> asked_;
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace vibrig::record
