#pragma once

#include <optional>
#include <span>

#include "daemon/noise/noise_monitor.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig::dwells {

/// The daemon's estimator stage and noise monitor with what the control thread does between two
/// dwells, all in the caller's thread and without a clock: time is that of the samples.
class Player {
  public:
    explicit Player(const estimator::Settings& settings);
    Player(const Player&) = delete;
    Player& operator=(const Player&) = delete;

    /// Ends the dwell in progress. Throws std::runtime_error.
    void order(const rt::DwellOrder& order);
    /// kMost at once. Throws std::runtime_error.
    void push(std::span<const drivers::Sample> samples);
    /// One finished dwell, if there is one. `decide`: what the noise monitor says is done.
    bool take_done(rt::DwellDone& done, bool decide);

    [[nodiscard]] std::optional<noise::Found> noise_found() const { return noise_.found(); }
    /// Time of the newest sample.
    [[nodiscard]] drivers::Time now() const noexcept { return now_; }
    [[nodiscard]] estimator::Identification& identification() noexcept { return identification_; }

    static constexpr std::size_t kMost = 2048;  ///< samples at a time

  private:
    /// Nobody sleeps.
    class Awake final : public drivers::Waiter {
      public:
        void notify() noexcept override {}
        bool wait_until(drivers::Time) noexcept override { return true; }
    };

    Awake awake_;
    rt::Ring<drivers::Sample> ring_{4096};
    estimator::Identification identification_;
    rt::EstimatorStage stage_;
    noise::NoiseMonitor noise_;
    drivers::Time now_ = 0;
};

}  // namespace vibrig::dwells
