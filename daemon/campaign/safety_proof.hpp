#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/campaign/stop_monitor.hpp"
#include "daemon/interlock/rest_monitor.hpp"
#include "daemon/status/status.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/level/in_step.hpp"

namespace vibrig::campaign {

struct ProofSettings {
    bool demanded = true;  ///< without one no campaign is armed
    double valid_h = 168;
    double emergency_stop_days = 365;                  ///< after so long its button is asked for
    std::vector<std::string> buttons{"rack", "door"};  ///< of the emergency stop
    double seen_s = 0.5;  ///< from the table's fall until its register shows one pressed
    /// What the proof covers, "key=value\n" each, sorted, values as --check prints them.
    std::string keys;
};

/// What the loop check found at one frequency of the plan, against which dwells there are held.
struct FoundInStep {
    double hz = 0;  ///< of the vibration as it was asked for
    estimator::InStep found;
};

/// One proof, as the journal keeps it.
struct ProofRecord {
    std::string by;
    std::int64_t utc_ns = 0;
    double table_g = 0;  ///< peak, at the table; 0: a run at 0 g, which alone proves no safe state
    bool passed = false;
    bool emergency_stop = false;  ///< its button was pressed, and the rig obeyed
    std::string button;           ///< which one was; empty: nobody said
    std::string message;          ///< why it did not pass
    std::vector<CheckRow> rows;
    PadRingDown pads;
    double pads_hz = 0, pads_damping = 0;
    double transmission = 0;  ///< platform over table, of a loop check in band; 0: not measured
    /// The same at further frequencies of the plan, Hz first.
    std::vector<std::pair<double, double>> transmissions;
    std::vector<FoundInStep> in_step;  ///< of those in band; earlier records have none
    std::string keys, keys_sha256;     ///< as in ProofSettings
    std::string device;  ///< the identity that the shaker's controller reports; empty: not asked

    /// What is not known is left out.
    void found(double hz, const estimator::InStep& one) {
        if (one.platform_g > 0) in_step.push_back({hz, one});
    }
};

/// As the journal and people's tools keep it.
[[nodiscard]] std::string to_json(const ProofRecord& record);
/// Nothing if it is no such text; `why` then says so, what was found where, and what was expected.
[[nodiscard]] std::optional<ProofRecord> proof_from_json(const std::string& text,
                                                         std::string* why = nullptr);

/// When each who can tell first said that a stop was done, s after the order; empty: not yet.
class StopTimes {
  public:
    void begin(drivers::Time now);
    void look(const drivers::ShakerReading& reading, const rt::Rest& rest);
    [[nodiscard]] drivers::Time from() const { return from_; }
    /// When the table stood: by its accelerometer, or without one by the controller's word.
    [[nodiscard]] double table_stood_s() const {
        return table_s.value_or(controller_s.value_or(0));
    }

    std::optional<double> controller_s, table_s, platform_s;
    bool table_known = false;  ///< it has an accelerometer

  private:
    drivers::Time from_ = 0;
};

/// What has been proved of stopping: every record that there is, and the one in the making. Control
/// thread only.
class SafetyProof {
  public:
    explicit SafetyProof(ProofSettings settings);

    /// Oldest first, of earlier lives.
    void take_over(std::vector<ProofRecord> history);
    /// The identity that the shaker's controller reports: a proof of another one counts for
    /// nothing. Until it is known each counts.
    void device_is(std::string device) { device_ = std::move(device); }
    void begin(const std::string& by, double table_g);
    void row(std::string name, std::string unit, double value, double low, double high);
    /// A step that either is so or is not.
    void row(std::string name, bool so) { row(std::move(name), "", so ? 1 : 0, 1, 1); }
    [[nodiscard]] ProofRecord& record() { return record_; }
    [[nodiscard]] const ProofRecord& record() const { return record_; }
    /// The making is over; `why` it was not completed, else empty. Returns the record.
    const ProofRecord& conclude(std::int64_t utc_ns, const std::string& why);

    /// " "rack"", where it was named which button is to be pressed.
    [[nodiscard]] std::string named_button() const {
        return record_.button.empty() ? "" : " \"" + record_.button + "\"";
    }

    /// Why no campaign is armed; empty: as far as this goes it may be.
    [[nodiscard]] std::string refusal(std::int64_t utc_ns) const;
    /// A warning although nothing is refused: a button that nobody pressed for long.
    [[nodiscard]] std::string advice(std::int64_t utc_ns) const;
    /// Which stop of the newest proof takes clearly longer than those before it took: a contactor
    /// that wears. Empty: none, or too few to tell.
    [[nodiscard]] std::string trend() const;
    /// For a recording and its report: the newest record whole, of the others times and verdict,
    /// JSON. Empty: there is none.
    [[nodiscard]] std::string recording_json() const;
    void fill(ProofStatus& status, std::int64_t utc_ns) const;
    [[nodiscard]] const std::vector<ProofRecord>& history() const { return history_; }
    /// Proofs with the keys as they are, oldest first.
    [[nodiscard]] std::vector<ProofRecord> with_these_keys() const;
    /// With these keys the controller has run at 0 g, and its watchdog has stopped it there.
    [[nodiscard]] bool ran_at_zero() const;
    /// Why a shaker whose numbers nobody understands yet does not shake: what comes before it, at
    /// 0 g, was not proved with these keys. Empty: it was.
    [[nodiscard]] std::string lacks_at_zero() const;
    /// Buttons of the emergency stop that no proof that passed had pressed.
    [[nodiscard]] std::vector<std::string> buttons_left() const;
    /// As the newest loop check in band has measured it with the configuration as it is; nothing
    /// otherwise: then the configuration's holds.
    [[nodiscard]] std::optional<double> transmission() const;
    /// Likewise at the plan's further frequencies.
    [[nodiscard]] std::vector<std::pair<double, double>> transmissions() const;
    /// Likewise what went in step with the vibration at each frequency; empty: not measured.
    [[nodiscard]] std::vector<FoundInStep> in_step() const;
    /// As the newest proof that passed has it; without one a documented allowance.
    [[nodiscard]] PadRingDown pads() const;

  private:
    [[nodiscard]] bool of_this_rig(const ProofRecord& one) const {
        return one.keys_sha256 == keys_sha256_ && of_this_device(one);
    }
    [[nodiscard]] bool of_this_device(const ProofRecord& one) const {
        return device_.empty() || one.device == device_;
    }
    [[nodiscard]] const ProofRecord* newest_passed() const;
    /// Not of a run at 0 g.
    [[nodiscard]] const ProofRecord* newest_shaken() const;
    /// If it is of the configuration as it is.
    [[nodiscard]] const ProofRecord* newest_of_these_keys() const;

    ProofSettings settings_;
    std::string keys_sha256_, device_;
    std::vector<ProofRecord> history_;
    ProofRecord record_;
};

/// Hexadecimal SHA-256.
[[nodiscard]] std::string sha256(const std::string& text);

}  // namespace vibrig::campaign
