#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/safety_proof.hpp"
#include "daemon/campaign/stop_monitor.hpp"
#include "daemon/domain/positions.hpp"
#include "daemon/interlock/amplitude_witness.hpp"
#include "daemon/interlock/rest_monitor.hpp"
#include "drivers/gimbal/torquer.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/filter/measurement.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/spectrum/elastic.hpp"
#include "estimator/spectrum/sweep_bounds.hpp"

namespace vibrig::campaign {

/// Table 1 of Tang et al. 2009: outer, inner, azimuth in deg.
inline const std::vector<std::array<double, 3>> kTable1Positions{
    {0, 0, 0},   {0, 0, 45},   {0, 0, 90},    {0, 0, 180}, {180, 0, 45}, {45, 0, 0},  {45, 0, 90},
    {90, 0, 90}, {90, 0, 180}, {180, 0, 270}, {270, 0, 0}, {270, 0, 90}, {-45, 0, 0}, {-45, 0, 90}};

/// Random vibration in place of a sine.
struct RandomStop {
    drivers::RandomSetPoint set_point;
    estimator::RandomVibration at_platform;
    std::uint16_t place = 0;  ///< of its abort bands: rt::Ramp::random
    std::string name{};       ///< of the profile
    /// At the platform, behind isolators whose transmission the loop check measures.
    std::vector<estimator::spectrum::Band> bands{};
};

/// One dwell of a campaign.
struct Stop {
    std::array<double, 3> position_deg{};  ///< as the encoders count
    double table_g = 0;
    double frequency_hz = 0;  ///< 0: [vibration] frequency_hz
    bool verify = false;      ///< held out: no part of the fit
    double transmission = 0;  ///< platform over table at that frequency; 0: as configured
    /// Then table_g and transmission are of the rms, and the frequency is 0.
    std::optional<RandomStop> random = {};
    /// In place of a frequency, which is 0 then.
    estimator::SweptSine sweep{};
    /// Platform over table, as the accelerometers show it, along the sweep:
    /// rt::Sweep::transmission.
    rt::Sweep::Along along{};

    /// What tells one kind of vibration from another: its frequency, its sweep, or a profile's
    /// number, which is below 0.
    [[nodiscard]] double kind() const {
        if (sweep.any()) return kind_of_sweep(sweep.from_hz, sweep.to_hz);
        return random ? -static_cast<double>(random->set_point.profile) : frequency_hz;
    }
};

/// Before each position: the platform's two channels across the vertical are brought level by fast
/// external damping (Zha et al. 2019), reference velocity zero or, of a rig on a moving base,
/// measured.
struct LevellingSettings {
    double settling_s = 100;
    double residual = 0.005;
    double damping = 0.7;
    double window_s = 10;           ///< of the means that the verdict rests on
    double tolerance_arcmin = 0.2;  ///< of both observables
    double torquer_limit_deg_h = 3000;
    double slow_settling_s = 0;  ///< of the gains to go over to once settled; 0: stay fast
    double slow_ramp_s = 60;     ///< that it takes to go over
    /// "Message.Signal" of the base's velocity along the rig's north and east axes, m/s; both or
    /// neither: the base stands.
    std::string velocity_north, velocity_east;
    double velocity_noise_mps = 0;  ///< of one reading, 1 sigma
    drivers::TorquerSettings torquer;
};

/// At the start and the end: the accelerometers' zeros from azimuth slews with the azimuth axis
/// vertical.
struct ZeroingSettings {
    double duration_s = 180;
    double slew_deg_per_s = 5;  ///< what the gimbals do; the filter checks it
    /// z down too: the zeros apart from what an accelerometer shows of 1 g along z, by misalignment
    /// or scale.
    bool both_ways = true;
    /// Platform y up and down too, slewed by the inner gimbal: the same where z cannot be down.
    bool second_axis = false;
    double scale_factor = 1e-4;  ///< of the accelerometers, not known better, 1 sigma
    /// How still the platform stands, 1 sigma at most.
    double velocity_reference_mps = 0.005, position_reference_m = 0.01;
    double angle_random_walk = 0.01;  ///< of the gyros while they turn, deg/sqrt(h)
    std::array<double, 3> target_mg{0.15, 0.05, 0.01};
    std::string gyro_message = "GyroIncrements";
    std::string accelerometer_message = "AccelerometerIncrements";
};

/// Before a campaign: a few seconds at a small level, and what the platform makes of it.
struct LoopCheckSettings {
    double table_g = 0.5;   ///< peak
    double measure_s = 5;   ///< at that level
    bool required = false;  ///< before a campaign is armed
    // bands
    double transmission_tolerance = 0.1;  ///< relative, about [vibration] transmission
    double frequency_tolerance_hz = 0.05;
    double distortion = 0.05;  ///< rms, of the fundamental
    double cross_share = 0.1;  ///< across the vertical, of the motion along it
    double phase_deg = -120;   ///< platform after table, where that has an accelerometer
    double phase_tolerance_deg = 60;
};

/// In which order the positions are visited at the levels.
enum class VisitOrder : std::uint8_t {
    balanced,    ///< no slow change of the bias looks like a coefficient
    sequential,  ///< level by level
    pairs,       ///< each position at all levels at once
    random
};

/// What follows when the verdict on the dwells so far becomes "not valid".
enum class OnNotValid : std::uint8_t {
    go_on,
    pause,  ///< at rest
    repeat  ///< the dwell that the verdict names, once
};

/// A stop of the opening check.
struct OpeningStop {
    std::array<double, 3> position_deg{};  ///< as the encoders count
    bool drifts = false;                   ///< let go there; else gravity alone is looked at
};

/// What the campaign does; amplitudes are peak at the table.
struct Settings {
    double sample_s = 0;  ///< between two samples, as configured; nothing works without it
    std::string name = "campaign";
    /// In a file gimbal angles; once it is loaded, as the encoders count.
    std::vector<std::array<double, 3>> positions_deg = kTable1Positions;
    std::vector<double> table_g{9.0, 7.0};  ///< one run each
    VisitOrder order = VisitOrder::balanced;
    /// The order itself: places in the list of levels, each with all positions; empty: that list.
    std::vector<std::size_t> sequence;
    std::string plan;            ///< plan file; empty: every position at every level
    std::string plan_warning;    ///< of the plan file, at its reading; empty: none
    double planned_dwell_s = 0;  ///< that the plan file was made for; 0: it states none
    std::vector<Stop> stops;     ///< of the plan file, in its order
    bool identify_all = true;    ///< refuse a campaign that cannot determine all 30 coefficients
    // Adaptive: chosen dwell by dwell until the standard errors are down to the targets (0: any).
    bool adaptive = false;
    double target_bias = 0;       ///< deg/h
    double target_linear = 0;     ///< deg/h/g
    double target_quadratic = 0;  ///< deg/h/g^2
    double time_limit_s = 0;      ///< of an adaptive campaign; 0: none
    bool type_prior = false;      ///< it starts from what the archive knows of the unit's type
    bool read_psd = false;        ///< after each random dwell, from the shaker's controller
    bool levelling = false;       ///< before each position
    bool zeroing = false;         ///< at start and end
    /// Where the opening check looks; empty: there is none.
    std::vector<OpeningStop> opening;
    bool open_first = true;  ///< with it each campaign begins
    LevellingSettings level;
    ZeroingSettings zero;
    LoopCheckSettings loop;
    estimator::Settings rig;     ///< [site], [platform], [accelerometer], [noise]
    double frequency_hz = 15.0;  ///< [vibration] frequency_hz
    bool hard_mount = false;     ///< [spectrum] mount: the platform is bolted to the table
    double dwell_s = 100.0;
    double settle_s = 3.0;  ///< after the ramp, 2 s at least
    double ramp_s = 2.0;
    double ready_timeout_s = 600.0;  ///< platform ready and temperature steady
    double temperature_window_s = 60.0;
    double temperature_band_c = 0.5;    ///< largest spread within the window
    double amplitude_tolerance = 0.05;  ///< relative; measured against commanded after the ramp
    int rejected_in_a_row = 2;          ///< dwells, after which it pauses at rest
    OnNotValid on_not_valid = OnNotValid::go_on;
    /// Gravity against encoders: beyond it nothing is ramped. A simulated rig is not commissioned.
    double gravity_refused_deg = 0.5;
    rt::RestSettings rest;
    StopSettings stop;
    ProofSettings proof;
    double watchdog_timeout_s = 1.5;  ///< written to the controller
    double arming_valid_s = 600.0;    ///< an arming ends after so long without a start
    bool second_person = false;       ///< after an emergency stop two persons acknowledge it
    std::string unit;                 ///< type and serial, for whoever arms
    // limits of the shaker, checked at the frequency in force
    double max_acceleration_g = 12.0;
    double max_velocity_mps = 1.5;
    double max_displacement_mm = 12.0;  ///< peak
    double resonance_hz = 0.0;          ///< of the isolators; 0: from frequency and transmission
    estimator::spectrum::SweptBy swept_by;

    /// How long its dwell takes, s; that of a sweep is as long as the latest honest one.
    [[nodiscard]] double dwell_s_of(const Stop& one) const {
        return one.sweep.any() ? estimator::spectrum::SweepBounds(one.sweep, swept_by).dwell_s()
                               : dwell_s;
    }
};

}  // namespace vibrig::campaign
