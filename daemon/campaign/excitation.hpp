#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "daemon/campaign/ports.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/campaign/stop_monitor.hpp"

namespace vibrig::campaign {

/// What is asked of the shaker under an arming: levels, ramps down, stops, and whether it does what
/// was commanded. The witnesses of the table get the same. Control thread only.
class Excitation {
  public:
    Excitation(const Settings& settings, Rig& rig, StopMonitor& stop)
        : settings_(settings), rig_(rig), stop_(stop), frequency_hz_(settings.frequency_hz) {}

    /// From now on a stop that another thread orders ends the arming.
    void armed() { armed_under_ = rig_.shaker.stops(); }
    /// Whom a ramp is for: the highest level of it, peak at the table, and whether it is a
    /// campaign's.
    void for_whom(double highest_g, bool campaign) {
        highest_g_ = highest_g;
        campaign_ = campaign;
    }
    /// From rest, where the gimbals are (deg): what was commanded last is over, and no witness
    /// may hold it to that.
    void from_rest(const Stop& stop, drivers::Time now);
    /// Platform over table at a frequency, as the loop check has measured it.
    void measured(double frequency_hz, double transmission) {
        measured_[frequency_hz] = transmission;
    }
    /// What the mean square of a random vibration at the platform is of what the transmission makes
    /// of it that is configured (docs/spectrum.md).
    [[nodiscard]] double power_ratio(const RandomStop& of) const;
    /// Where the gimbals are while the table moves, deg as the encoders count.
    void place(const std::array<double, 3>& position_deg) { position_deg_ = position_deg; }
    [[nodiscard]] const std::array<double, 3>& position_deg() const { return position_deg_; }
    [[nodiscard]] double frequency_hz() const { return frequency_hz_; }
    /// In place of a sine; none: a sine.
    [[nodiscard]] const std::optional<RandomStop>& random() const { return random_; }
    [[nodiscard]] const estimator::SweptSine& sweep() const { return sweep_; }
    /// It has begun then, and goes so fast: the witnesses go with it.
    void follow(drivers::Time begun, double octaves_per_s, drivers::Time now);
    /// By its read-back the controller has this kind of vibration set already.
    [[nodiscard]] bool chosen() const;

    /// A part begins in which one thing is asked for at most: its time counts from here.
    void begin_part(drivers::Time now) {
        since_ = now;
        asked_ = stop_sent_ = false;
    }
    [[nodiscard]] drivers::Time since() const { return since_; }
    /// Within this part the set-point was accepted.
    [[nodiscard]] bool asked() const { return asked_; }
    /// Asks for a level, 0 being the way down; `run_at_zero`: it runs there. False: the shaker
    /// takes no set-point.
    [[nodiscard]] bool ask(double table_g, drivers::Time now, bool run_at_zero = false);
    /// When a level was asked for last.
    [[nodiscard]] drivers::Time asked_at() const { return asked_at_; }
    /// Asks for it once, and waits for it; 0: for the controller to run there. Why it does not
    /// come, else empty; `reached` once it is there.
    [[nodiscard]] std::string climb(double table_g, drivers::Time now, bool& reached);

    enum class Rests : std::uint8_t { not_yet, at_rest, overdue };
    /// Ramps down until rest is measured; overdue is reported once.
    [[nodiscard]] Rests come_to_rest(drivers::Time now);

    /// A stop of this thread's own, which does not end the arming.
    void stop(const std::string& by);
    /// The end of what is under way.
    void order_stop(const std::string& by);
    [[nodiscard]] const std::string& stopped_by() const { return stopped_by_; }
    /// A stop of another thread comes before the word of who ordered it and why, which is to be
    /// the reason; for so long it is waited for.
    [[nodiscard]] bool stopped_by_another(drivers::Time now);

    [[nodiscard]] bool as_commanded(double table_g) const;
    /// Why it does not do that, which another's stop does not explain; empty: it does.
    [[nodiscard]] std::string off_command(double table_g, drivers::Time now);
    /// Another frequency is refused while the table moves: true if this one is.
    [[nodiscard]] bool refuses_frequency(double frequency_hz, double table_g);

    /// What the table may seem to do where the controller runs at 0 g.
    static constexpr double kAtZero_g = 0.01;
    /// How much later than the ramp itself the controller may report the level as reached.
    static constexpr drivers::Time kRampGrace = 10 * drivers::kSecond;

  private:
    void tell_ramp(double table_g, drivers::Time now);
    [[nodiscard]] drivers::ShakerSetPoint set_point(double table_g, bool run_at_zero) const;
    [[nodiscard]] bool plays_as_commanded(const drivers::ShakerReading& reading) const;

    const Settings& settings_;
    Rig& rig_;
    StopMonitor& stop_;
    std::array<double, 3> position_deg_{};
    double frequency_hz_;
    std::optional<RandomStop> random_;
    estimator::SweptSine sweep_{};
    rt::Sweep follows_{};                ///< as the witnesses have it
    double transmission_ = 0;            ///< see Stop
    std::map<double, double> measured_;  ///< transmissions by frequency, as measured
    double highest_g_ = 0;
    bool campaign_ = true;
    drivers::Time since_ = 0;
    bool asked_ = false;
    bool stop_sent_ = false;  ///< the ramp down took too long, or none was to be had
    drivers::Time asked_at_ = 0;
    double asked_g_ = 0;  ///< of the shaker, last
    std::string stopped_by_ = "the start of the daemon";
    /// Stops of the shaker when it was armed, and this thread's own since; and when one of another
    /// thread was found, since when.
    std::uint64_t armed_under_ = 0, stopped_under_ = 0;
    drivers::Time stopped_since_ = 0;
};

}  // namespace vibrig::campaign
