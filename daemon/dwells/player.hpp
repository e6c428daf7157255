#pragma once

#include <span>

#include "daemon/dwells/dwell_book.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig::dwells {

/// Samples through the daemon's estimator stage into a book, all in the caller's thread and without
/// a clock: time is that of the samples.
class Player {
  public:
    explicit Player(const estimator::Settings& settings,
                    DwellBook::Noise noise = DwellBook::Noise::decided);
    Player(const Player&) = delete;
    Player& operator=(const Player&) = delete;

    /// Ends the dwell in progress. Throws std::runtime_error.
    void order(const rt::DwellOrder& order);
    /// kMost at once. Throws std::runtime_error.
    void push(std::span<const drivers::Sample> samples);
    /// One finished dwell, if there is one.
    [[nodiscard]] bool take_done(rt::DwellDone& done) { return book_.take_done(stage_, done); }
    [[nodiscard]] DwellBook& book() noexcept { return book_; }
    [[nodiscard]] const DwellBook& book() const noexcept { return book_; }

    /// The filter as displays saw it last: after a dwell as it was at its very end.
    [[nodiscard]] estimator::Estimate shown() const { return stage_.view().estimate; }
    /// Time of the newest sample.
    [[nodiscard]] drivers::Time now() const noexcept { return now_; }

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
    DwellBook book_;
    rt::EstimatorStage stage_;
    drivers::Time now_ = 0;
};

}  // namespace vibrig::dwells
