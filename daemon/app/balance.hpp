#pragma once

#include <optional>
#include <string>

#include "daemon/domain/services.hpp"
#include "daemon/log/log_queue.hpp"
#include "daemon/rt/acquisition.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/ring.hpp"
#include "drivers/shaker/shaker.hpp"

namespace vibrig {

/// What every stage has counted. Taken in this order: what is handed over is counted by whoever
/// takes it after whoever gives it.
struct Counted {
    rt::AcquisitionView acquisition;
    rt::EstimatorView estimator;
    rt::RingCounts ring;                     ///< the estimator's
    std::optional<rt::RingCounts> recorder;  ///< its ring of samples; nothing: none is kept
    drivers::ShakerCounters shaker;
    JournalStatus journal;
    log::Counts log;
};

/// received = handled + dropped (by reason) + waiting, of every stage.
class Balance {
  public:
    /// The stages that do not balance, and by what; empty: all do. What two threads count is never
    /// read at one moment: where the one has counted what the other hands over, it has to be at
    /// least what the other had at the look before, and at most what it has now. A thread takes
    /// less than a second from the one to the other, so that is how long is between two looks.
    [[nodiscard]] std::string look(const Counted& now);

  private:
    Counted before_;
};

}  // namespace vibrig
