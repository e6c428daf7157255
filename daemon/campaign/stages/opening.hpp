#pragma once

#include <cstdint>

#include "daemon/campaign/opening_check.hpp"
#include "daemon/campaign/stages/stage.hpp"
#include "daemon/campaign/stop_monitor.hpp"

namespace vibrig::campaign {

/// Why gimbals may not slew now: only at rest; empty: they may.
[[nodiscard]] std::string may_slew(const Rig& rig, const StopMonitor& stop);

/// The opening check on the rig: gimbals slew and drift, the table rests. What it found judges
/// check().
class Opening : public Stage {
  public:
    Opening(const Settings& settings, Rig& rig, const StopMonitor& stop)
        : rig_(rig), stop_(stop), check_(settings) {}

    void begin(drivers::Time now) override;
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override { check_.end(); }
    [[nodiscard]] const OpeningCheck& check() const { return check_; }

  private:
    enum class Part : std::uint8_t { go, slew, release, measure };

    Rig& rig_;
    const StopMonitor& stop_;
    OpeningCheck check_;
    Part part_ = Part::go;
};

}  // namespace vibrig::campaign
