#pragma once

#include <string>

#include "daemon/campaign/excitation.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/safety_proof.hpp"
#include "daemon/campaign/stages/stage.hpp"

namespace vibrig::campaign {

/// What the loop check and the safe-state proof act on and write into, and what is the same in
/// both: the rig at their small level, watched sample by sample.
class SmallLevel {
  public:
    SmallLevel(const Settings& all, const Ports& used, Excitation& excited, StopMonitor& stopped,
               LoopCheck& checked, SafetyProof& proved)
        : settings(all),
          ports(used),
          excitation(excited),
          stop(stopped),
          loop(checked),
          proof(proved) {}

    const Settings& settings;
    Ports ports;
    Excitation& excitation;
    StopMonitor& stop;
    LoopCheck& loop;
    SafetyProof& proof;

    void begin(drivers::Time now);
    void take_samples(drivers::Time now);
    /// Why it cannot go on; empty: it can. Takes the samples.
    [[nodiscard]] std::string lacks(drivers::Time now);
    /// Likewise, of a table that is to do this now. An open chain is the interlock's.
    [[nodiscard]] std::string off_command(drivers::Time now);
    /// `steady`: the table is at the level all the time.
    void begin_part(bool steady, Proving what, drivers::Time now);

  private:
    drivers::Time last_motion_ = 0;
};

}  // namespace vibrig::campaign
