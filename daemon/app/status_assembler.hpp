#pragma once

#include <mutex>
#include <vector>

#include "daemon/app/control_loop.hpp"
#include "daemon/app/outside.hpp"
#include "daemon/app/parts.hpp"

namespace vibrig {

/// Puts together what the parts show of themselves, for whoever asks. Any thread.
class StatusAssembler {
  public:
    StatusAssembler(const Parts& parts, const ControlLoop& control, const Outside& outside)
        : parts_(parts), control_(control), outside_(outside) {}

    [[nodiscard]] StatusData status() const;
    /// The server tells of itself.
    void serving(const ServerStatus& server);

  private:
    [[nodiscard]] RealTimeStatus real_time_status(const rt::AcquisitionView& acquired,
                                                  const rt::EstimatorView& estimated) const;
    /// Made from what the status has already.
    [[nodiscard]] VibrationStatus vibration(const StatusData& status) const;
    [[nodiscard]] InterlockStatus interlock_status(std::vector<Latch> latches) const;

    const Parts& parts_;
    const ControlLoop& control_;
    const Outside& outside_;
    mutable std::mutex mutex_;  ///< guards what follows
    ServerStatus server_;
};

}  // namespace vibrig
