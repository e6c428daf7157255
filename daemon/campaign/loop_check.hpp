#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "daemon/status/status.hpp"
#include "estimator/level/in_step.hpp"
#include "estimator/level/loop_response.hpp"
#include "estimator/level/ring_down.hpp"

namespace vibrig::campaign {

/// Which unit the controller may have been given for another, by table over command; empty: none.
[[nodiscard]] std::string unit_of_ratio(double ratio);

/// Lowest and highest of what the transmission does from one frequency to another above the
/// resonance, over what it was: of a mass on a spring with any damping up to half of the critical,
/// |T|^2 = (1 + z x) / ((1 - x)^2 + z x), x = (f/fn)^2, z = (2 damping)^2 (Tang et al. 2009, eq.
/// 3). 1 and 1 of a rigid mount, `transmission` 1.
[[nodiscard]] std::array<double, 2> isolator_ratio(double transmission, double from_hz,
                                                   double to_hz);

/// The newest loop check: collects samples at rest and at the small level, and says what is out of
/// band. Control thread only.
class LoopCheck {
  public:
    LoopCheck(const LoopCheckSettings& settings, const estimator::Settings& rig);

    void begin(const std::string& by);
    void add(const rt::Motion& motion);
    /// What came so far was at rest: where the gimbals are, deg as the encoders count. Why the rig
    /// cannot be checked, else empty.
    [[nodiscard]] std::string look(std::array<double, 3>& position_deg) const;
    /// rms of the norm of the specific force, and of the table's acceleration, less their means,
    /// over what counts, g; the table's 0 where it has no good accelerometer.
    struct Noise {
        double platform_g = 0, table_g = 0;
    };
    [[nodiscard]] Noise noise() const;
    /// What counts is of a rig at rest: how much of later vibration is noise.
    void rests() { at_rest_ = noise(); }
    /// Mean of the norm of the specific force over what counts, g.
    [[nodiscard]] double mean_force_g() const;
    /// Amplitudes of a vibration, peak, less what was noise at rest.
    [[nodiscard]] Noise peak() const;
    /// The last moment at which the table (or the platform, where the table has no accelerometer)
    /// was beyond half of its highest; 0: nothing counts.
    [[nodiscard]] drivers::Time last_at_half() const;
    /// From now on what counts.
    void measure() {
        readings_.clear();
        bad_ = 0;
    }
    /// While the level is still coming up, linearly over `ramp_s` from when it was asked for: table
    /// (platform over the transmission, where it has no accelerometer) over command; 0: unknown.
    [[nodiscard]] double over_command(drivers::Time asked, double ramp_s) const;
    /// How the platform swings on its pads by itself, of what counts since then.
    [[nodiscard]] estimator::RingDown ring_down_since(drivers::Time time) const;
    /// Judges it, `shaker_g` being what the controller reports of the table: that is held against
    /// the command as the accelerometers are, and is no witness of them.
    void finish(double shaker_g);
    /// The same at another frequency, where the platform is to do from `low` to `high` times what
    /// the table does; before finish(), whose verdict it is part of.
    struct AtFrequency {
        double hz = 0, transmission = 0;  ///< of the vibration as it was asked for; as measured
        std::vector<CheckRow> rows;
        estimator::InStep in_step;
    };
    [[nodiscard]] AtFrequency finish_at(double hz, double low, double high);
    /// Likewise, to `transmission` within the configured tolerance.
    [[nodiscard]] AtFrequency finish_at(double hz, double transmission) {
        const double tolerance = settings_.transmission_tolerance;
        return finish_at(hz, transmission * (1 - tolerance), transmission * (1 + tolerance));
    }
    void conclude();  ///< the table is at rest again: it is over
    void not_completed(const std::string& why);

    /// What the newest one that was completed found out of its band; empty: nothing. One of an
    /// earlier life is taken over before anything else.
    [[nodiscard]] const std::string& out_of_band() const { return out_of_band_; }
    void take_over(const std::string& out_of_band);
    /// Why no campaign is armed; empty: as far as this goes it may be.
    [[nodiscard]] std::string refusal() const;
    [[nodiscard]] const LoopCheckStatus& status() const { return status_; }
    /// Platform over table as measured; over the command where the table has no accelerometer.
    [[nodiscard]] double transmission() const { return transmission_; }
    /// At the reference frequency.
    [[nodiscard]] const estimator::InStep& in_step() const { return in_step_; }
    /// Frequencies of a plan's dwells apart from the reference one, each once, as stops.
    [[nodiscard]] static std::vector<Stop> further_frequencies(const Settings& settings);
    /// The shaker's limit that the level exceeds at any frequency; empty: none.
    [[nodiscard]] static std::string beyond_limits(const Settings& settings);

  private:
    /// Readings that count and are not older than `time`.
    [[nodiscard]] std::span<const estimator::LoopReading> readings_since(drivers::Time time) const;
    /// What moves: of the table where it is known throughout, else of the platform; less its mean.
    [[nodiscard]] std::vector<double> motion() const;
    [[nodiscard]] double most_in_step() const;  ///< arcsec per g at the platform
    void row(const char* name, const char* unit, double value, double low, double high);
    /// Judges a row; `at` stands before its name where it is out of band.
    CheckRow judged(const char* name, const char* unit, double value, double low, double high,
                    const std::string& at);

    LoopCheckSettings settings_;
    estimator::Settings rig_;
    RigFrame frame_;
    std::vector<estimator::LoopReading> readings_;
    Vector angle_rad_{};
    std::size_t bad_ = 0;  ///< samples without good force or angles
    Noise at_rest_;
    bool passed_ = false;
    double transmission_ = 0;
    estimator::InStep in_step_;
    std::string out_of_band_;  ///< of the newest that was completed
    std::string found_wrong_;  ///< of the one under way
    LoopCheckStatus status_;
};

}  // namespace vibrig::campaign
