#pragma once

#include <optional>
#include <string>

#include "daemon/campaign/excitation.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/safety_proof.hpp"
#include "daemon/campaign/stages/stage.hpp"

namespace vibrig::campaign {

/// At rest, before.
inline constexpr drivers::Time kLook = 2 * drivers::kSecond;
/// Duration of a stop that nobody saw end, s.
inline constexpr double kNever_s = 1e3;

/// What the run at 0 g, the loop check and the safe-state proof act on and write into, and what is
/// the same in them: the rig at their small level, watched sample by sample.
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
    /// Level of this check, peak at the table; 0: the controller runs, the table stands.
    double level_g = 0;

    /// A proof by this person begins.
    void begin(const std::string& by, double table_g, drivers::Time now);
    /// After some seconds: gravity, rest and the noise of those who call it. Why not, else empty.
    [[nodiscard]] std::string look_at_rest(drivers::Time now);
    void take_samples(drivers::Time now);
    /// Why it cannot go on; empty: it can. Takes the samples.
    [[nodiscard]] std::string lacks(drivers::Time now);
    /// Likewise, of a table that is to do this now. An open chain is the interlock's.
    [[nodiscard]] std::string off_command(drivers::Time now);
    /// The way down at the end: done() at rest.
    [[nodiscard]] StageStep come_to_rest(drivers::Time now);
    /// Whether the stop since the part began has cleared the watchdog's fault; none: not yet.
    [[nodiscard]] std::optional<bool> fault_cleared(drivers::Time now) const;
    /// `steady`: the table is at the level all the time.
    void begin_part(bool steady, Proving what, drivers::Time now);

  private:
    [[nodiscard]] bool quiet();

    drivers::Time last_motion_ = 0;
};

}  // namespace vibrig::campaign
