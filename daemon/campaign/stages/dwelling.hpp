#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/excitation.hpp"
#include "daemon/campaign/in_step_watch.hpp"
#include "daemon/campaign/stages/stage.hpp"
#include "daemon/campaign/sweep_watch.hpp"
#include "daemon/campaign/zero_calibration.hpp"
#include "estimator/level/loop_response.hpp"

namespace vibrig::campaign {

/// One dwell on the rig: the table ramps up, settles, and what comes then is the estimator's.
/// Leaves the table vibrating. Asks, before the ramp, whether gravity is where the encoders say:
/// ramp() goes on.
class Dwelling : public Stage {
  public:
    struct Aim {
        Stop stop;
        int run = 0, position = 0;
        bool first = false;  ///< no dwell of this campaign before it
        /// What the loop check found at its frequency; none: it has not looked there.
        std::optional<FoundInStep> in_step;
    };

    Dwelling(const Settings& settings, const Ports& ports, Excitation& excitation,
             const StopMonitor& stop)
        : settings_(settings), ports_(ports), excitation_(excitation), stop_(stop) {}

    /// A new campaign, or one that goes on after `before`, its last dwell of an earlier life.
    void reset(std::optional<StopDone> before);
    /// What begins next; `zeros` in force, null: none are taken.
    void aim(const Aim& aim, const ZeroCalibration* zeros);
    void begin(drivers::Time /*now*/) override { part_ = Part::ramp; }
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override;
    [[nodiscard]] double table_g() const override { return aim_.stop.table_g; }

    [[nodiscard]] StageStep ramp(drivers::Time now);
    /// The state that this is for people and the interlock.
    [[nodiscard]] CampaignState state() const;
    /// The estimator has it whole.
    void done() { done_ = true; }
    /// The gyros were seen run down since the dwell before.
    void lost_power() { power_lost_ = true; }
    [[nodiscard]] estimator::DwellInfo info() const;
    /// By the transmission as measured.
    [[nodiscard]] estimator::RandomVibration random_at_platform() const;
    /// What the controller reported of a sweep's frequency, s since the dwell began and Hz.
    [[nodiscard]] const std::vector<std::array<double, 2>>& swept_hz() const { return swept_hz_; }
    /// Rms of random vibration by the controller's readings while it recorded; 0: there were none.
    [[nodiscard]] double measured_g_rms() const {
        return readings_ > 0 ? std::sqrt(square_ / readings_) : 0;
    }
    [[nodiscard]] std::int64_t utc_ns() const { return utc_ns_; }  ///< of its beginning
    /// While it records: how much of it is done, 0 to 1, and what is left, s.
    [[nodiscard]] double part_done(drivers::Time now) const;
    [[nodiscard]] double left_s(drivers::Time now) const;

  private:
    enum class Part : std::uint8_t { ramp, settle, record };

    [[nodiscard]] StageStep settled_or_recording(drivers::Time now);
    [[nodiscard]] StageStep order(drivers::Time now);
    [[nodiscard]] drivers::Time poll() const;
    void take_over_origin();
    /// Why it may not, else empty; `may` once it may.
    [[nodiscard]] std::string vibration_may_change(drivers::Time now, bool& may) const;
    void watch_vibration(const rt::DwellOrder& order);
    void follow_sweep(drivers::Time now);
    void end_sweep();
    void note_rms();
    void begin_in_step();
    void watch_in_step();
    void end_in_step();
    void trip(const std::string& why);
    [[nodiscard]] double dwell_s() const;
    void look_at_vibration(drivers::Time now);
    /// What the accelerometers show in place of what was asked for; empty: that.
    [[nodiscard]] std::string other_frequency() const;
    [[nodiscard]] std::string other_level() const;

    const Settings& settings_;
    Ports ports_;
    Excitation& excitation_;
    const StopMonitor& stop_;
    Aim aim_;
    const ZeroCalibration* zeros_ = nullptr;
    Part part_ = Part::ramp;
    bool ordered_ = false, done_ = false;
    bool power_lost_ = false;
    drivers::Time from_ = 0, to_ = 0;
    std::int64_t utc_ns_ = 0;
    std::optional<drivers::Time> origin_;  ///< when the campaign's first dwell began
    std::optional<StopDone> before_;
    bool watching_ = false;  ///< the accelerometers are to show it before the dwell
    std::vector<estimator::LoopReading> shown_;
    std::optional<SweepWatch> sweep_;
    std::optional<InStepWatch> in_step_;
    drivers::Time read_at_ = 0;         ///< the controller's frequency or rms, last
    double square_ = 0, readings_ = 0;  ///< of that rms
    std::vector<std::array<double, 2>> swept_hz_;
};

}  // namespace vibrig::campaign
