#pragma once

#include <atomic>
#include <cstdint>

#include "daemon/rt/dwell_feed.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/fed.hpp"
#include "daemon/rt/real_time.hpp"
#include "daemon/rt/ring.hpp"
#include "drivers/base/clock.hpp"
#include "drivers/base/snapshot.hpp"
#include "drivers/sample/sample.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::rt {

/// Samples of the estimator's ring: taken = in_dwell + idle.
struct EstimatorView {
    estimator::Estimate estimate;
    std::uint64_t taken = 0, in_dwell = 0, idle = 0;
    drivers::Time sample_time = 0;  ///< of the newest sample taken
    double dwell_fraction = 0;      ///< 0 to 1 in a dwell, else 0
    Lateness lateness;              ///< from samples in the ring until done with
    PageFaults faults;
};

/// Second stage, on its own thread: feeds the samples of ordered dwells to the identification.
/// Between the end of one dwell and the order of the next the Identification belongs to the control
/// thread, which may read or replace it.
class EstimatorStage {
  public:
    EstimatorStage(Ring<drivers::Sample>& samples, drivers::Waiter& self, drivers::Waiter& control,
                   estimator::Identification& identification);

    /// The thread's body; returns after stop(). Neither allocates, locks, logs nor formats.
    void run() noexcept;
    /// In place of run(), where one thread does all: what waits in the rings, and no more.
    void work() noexcept;
    void stop() noexcept;  ///< any thread

    /// Before run(), in its thread: it works on the CPU where samples are handed over, and goes
    /// along when the giver moves. To be woken on another CPU costs several times as much as what a
    /// sample takes here. Nobody waits for the other: who gives has more priority, and the kernel
    /// moves it where a long piece of work is in its way.
    void stay_by_giver() noexcept { stays_ = true; }

    /// Before run(): what goes into the filter goes there too.
    void feed_to(Ring<Fed>& journal) noexcept { journal_ = &journal; }

    /// Whoever fills the ring tells it, and asks it whether to notify.
    [[nodiscard]] HandOver& hand_over() noexcept { return handed_over_; }

    /// Before run(): samples that it is done with later than this count.
    void time_by(const drivers::Clock& clock, drivers::Time bound) noexcept;

    /// Before run(): it wants to be told of a sample only where a dwell ends or a display is due.
    /// What comes out is the same: where the rig waits until all sleep, a run is faster.
    void gather() noexcept { gathers_ = true; }

    /// Control thread only.
    bool order(const DwellOrder& order) noexcept;
    /// Control thread only: takes one finished dwell, if there is one.
    bool take_done(DwellDone& done) noexcept;
    /// Control thread only: takes one block of angles; those of a dwell come before its end.
    bool take_block(BlockRecord& block) noexcept;
    [[nodiscard]] EstimatorView view() const noexcept { return view_.read(); }
    [[nodiscard]] RingCounts ring() const noexcept { return samples_.counts(); }

  private:
    void take_order(const DwellOrder& order) noexcept;
    void take_samples() noexcept;
    void take_sample(const drivers::Sample& sample) noexcept;
    void finish(bool cut_short) noexcept;
    void publish(bool ours) noexcept;
    void follow() noexcept;

    Ring<drivers::Sample>& samples_;
    drivers::Waiter& self_;
    drivers::Waiter& control_;
    estimator::Identification& identification_;
    Ring<Fed>* journal_ = nullptr;
    const drivers::Clock* clock_ = nullptr;  ///< null: lateness does not count
    HandOver handed_over_;
    bool stays_ = false, gathers_ = false;
    int cpu_ = -1;  ///< it keeps to, of stay_by_giver()
    Ring<DwellOrder> orders_{8};
    Ring<DwellDone> done_{8};
    Ring<BlockRecord> blocks_{256};
    DwellFeed feed_;
    std::atomic<bool> stop_{false};

    DwellOrder current_;
    bool ordered_ = false;
    drivers::Time published_at_ = 0;
    EstimatorView shown_;
    Snapshot<EstimatorView> view_;
};

}  // namespace vibrig::rt
