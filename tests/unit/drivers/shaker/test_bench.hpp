#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "drivers/shaker/shaker.hpp"
#include "test_clock.hpp"
#include "test_server.hpp"

namespace vibrig::drivers::test {

// Addresses of the default register map.
inline constexpr int kFrequency = 0, kAmplitude = 2, kRampTime = 4, kRun = 5, kWatchdog = 6,
                     kWatchdogTimeout = 7;

[[nodiscard]] inline ShakerSettings settings_for(const TestServer& server) {
    ShakerSettings settings;
    settings.transport =
        server.device().empty() ? ShakerSettings::Transport::tcp : ShakerSettings::Transport::rtu;
    settings.port = server.port();
    settings.device = server.device();
    settings.baud = 115200;
    settings.response_timeout = 5 * kSecond;  // a test that needs it to end says so
    settings.poll_period = 50 * kMillisecond;
    settings.watchdog_period = 20 * kMillisecond;
    settings.backoff_min = 5 * kMillisecond;
    settings.backoff_max = 40 * kMillisecond;
    return settings;
}

/// A shaker that is started, with what it said.
class Bench {
  public:
    explicit Bench(const ShakerSettings& settings, bool feed = true)
        : may_feed(feed), shaker(make_shaker(clock_, settings)) {
        shaker->on_reading([this] { woken(); });
        shaker->start([this] { return may_feed.load(); },
                      [this](LinkState state, const char* text) {
                          const std::lock_guard lock(mutex_);
                          said_.emplace_back(state, text);
                          changed_.notify_all();
                      });
    }
    ~Bench() { shaker->shut_down(); }

    /// True as soon as `done`; false after a minute, which a busy machine may need.
    [[nodiscard]] bool eventually(const std::function<bool()>& done) {
        const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (!done()) {
            if (std::chrono::steady_clock::now() > deadline) return false;
            std::unique_lock lock(mutex_);
            changed_.wait_for(lock, std::chrono::milliseconds(2));
        }
        return true;
    }
    /// True when the shaker is in `state` and has said so: what it says follows the state.
    [[nodiscard]] bool reaches(LinkState state) {
        return eventually([&] {
            if (shaker->state() != state) return false;
            const auto lines = said();
            return !lines.empty() && lines.back().first == state;
        });
    }
    /// Asks for a set-point under whatever stops there were.
    [[nodiscard]] bool request(const ShakerSetPoint& set_point) {
        return shaker->request(set_point, shaker->stops());
    }
    /// Asks for a set-point and waits until it has been dealt with.
    [[nodiscard]] bool apply(const ShakerSetPoint& set_point) {
        return reaches(LinkState::running) && request(set_point) &&
               eventually([&] { return !shaker->busy(); });
    }
    [[nodiscard]] std::vector<std::pair<LinkState, std::string>> said() const {
        const std::lock_guard lock(mutex_);
        return said_;
    }

    std::atomic<bool> may_feed;

  private:
    void woken() {
        const std::lock_guard lock(mutex_);
        changed_.notify_all();
    }
    RealClock clock_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::vector<std::pair<LinkState, std::string>> said_;

  public:
    const std::unique_ptr<Shaker> shaker;
};

/// Addresses written, without those of the watchdog, in order.
[[nodiscard]] inline std::vector<int> addresses_written(const TestServer& server) {
    std::vector<int> addresses;
    for (const Request& write : server.writes()) {
        if (write.writes_run()) {
            addresses.push_back(kRun);
        } else if (write.address != kWatchdog && write.address != kWatchdogTimeout) {
            addresses.push_back(write.address);
        }
    }
    return addresses;
}

}  // namespace vibrig::drivers::test
