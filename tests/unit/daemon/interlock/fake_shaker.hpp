#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "drivers/shaker/shaker.hpp"

namespace vibrig {

/// Remembers what it was asked; the test decides what it reads back.
class FakeShaker final : public drivers::Shaker {
  public:
    FakeShaker() { now.watchdog = drivers::WatchdogTimeout::kept; }
    void start(std::function<bool()>, StateHandler) override {}
    [[nodiscard]] bool request(const drivers::ShakerSetPoint& set_point,
                               std::uint64_t under) noexcept override {
        if (refuse || stop_pending() || under != stops()) return false;
        requests.push_back(set_point);
        return true;
    }
    void stop_now() noexcept override {
        if (on_stop) on_stop();
        ++stops_asked;
        stop_waits = true;
    }
    void hang_up_until(drivers::Time time) noexcept override { hung_up_until = time; }
    void read_only(bool on) noexcept override { only_read = on; }
    [[nodiscard]] std::uint64_t stops() const noexcept override { return stops_asked; }
    [[nodiscard]] bool stop_pending() const noexcept override { return stop_waits; }
    [[nodiscard]] bool busy() const noexcept override { return writing; }
    [[nodiscard]] drivers::ShakerReading reading() const noexcept override { return now; }
    [[nodiscard]] drivers::ShakerCounters counters() const noexcept override { return counts; }
    [[nodiscard]] drivers::LinkState state() const noexcept override {
        return drivers::LinkState::running;
    }
    std::uint64_t read_psd() noexcept override {
        psd_asked_at_rest = psd_asked_at_rest && now.at_rest();
        return ++psds_asked;
    }
    [[nodiscard]] drivers::ShakerPsd psd() const override { return psd_answer; }
    void on_reading(std::function<void()>) override {}
    void shut_down() noexcept override {}

    /// Reads back at once what was asked last; a stop that waits comes first.
    void obey(drivers::Time time) {
        if (stop_waits.exchange(false)) requests.push_back({15, 0, 0});
        now.time = time;
        if (requests.empty()) return;
        const drivers::ShakerSetPoint& wanted = requests.back();
        now.amplitude_g = now.measured_g = wanted.amplitude_g;
        now.frequency_hz = wanted.frequency_hz;
        now.running = wanted.amplitude_g > 0;
        now.state = wanted.amplitude_g > 0 ? 2 : 0;
        now.sweep.reset();
        if (wanted.sweep) {
            const double minutes = drivers::to_seconds(time - runs_since(time)) / 60;
            const drivers::SweepSetPoint& commanded = *wanted.sweep;
            const double octaves = sweep_rate_scaled * commanded.octaves_per_minute *
                                   std::max(0.0, minutes - sweep_rests_s / 60);
            const bool up = commanded.to_hz > commanded.from_hz;
            const double hz = commanded.from_hz * std::exp2(up ? octaves : -octaves);
            now.sweep = {true, commanded.from_hz, commanded.to_hz, commanded.octaves_per_minute,
                         up ? std::min(hz, commanded.to_hz) : std::max(hz, commanded.to_hz)};
        }
        if (!wanted.random) {
            now.random.reset();
            return;
        }
        using State = drivers::RandomReading::State;
        now.random = {true,
                      wanted.random->profile,
                      wanted.random->level_db,
                      wanted.random->checksum,
                      wanted.amplitude_g,
                      now.running ? levelled : State::idle,
                      true,
                      abort_reason};
    }

    /// Since when the newest set-point is there.
    drivers::Time runs_since(drivers::Time time) {
        if (requests.size() != seen_) since_ = time;
        seen_ = requests.size();
        return since_;
    }
    double sweep_rate_scaled = 1, sweep_rests_s = 5;

    drivers::ShakerReading now;
    drivers::ShakerCounters counts;
    std::vector<drivers::ShakerSetPoint> requests;
    std::function<void()> on_stop;  ///< before it is ordered
    std::atomic<std::uint64_t> stops_asked{0};
    std::atomic<bool> stop_waits{false};
    drivers::Time hung_up_until = 0;
    bool only_read = false;
    drivers::ShakerPsd psd_answer;
    std::uint64_t psds_asked = 0;
    bool psd_asked_at_rest = true;
    bool refuse = false, writing = false;
    std::size_t seen_ = 0;
    drivers::Time since_ = 0;
    /// Of random vibration, once it runs.
    drivers::RandomReading::State levelled = drivers::RandomReading::State::at_level;
    std::uint8_t abort_reason = 0;
};

}  // namespace vibrig
