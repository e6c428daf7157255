#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vibrig::rt {

/// What the interlock watches; none: nothing tripped.
enum class Trip : std::uint8_t {
    none,
    stale_channel,
    stale_platform,
    loop_open,
    platform_fault,
    over_amplitude,
    emergency_stop,
    shaker_fault,
    uncommanded,
    can_lost,
    amplitude_off,
    frame_loss,
    gimbal_off,
    cross_axis,
    tilt,
    temperature,
    filter_divergence,
    read_back,
    shaker_lost,
    disk,
    recording,
    server,
    amplitude_witness,
    over_armed,
    stuck,
    stop_disobeyed,
    watchdog_changed,
    guard_lost,
    guard_stop,
    horn,
    wrong_vibration,
    abort_bands,
    motion_in_step,
    cross_growth
};
inline constexpr std::size_t kTrips = 34;

/// How much is watched. Each level includes the one before.
enum class Guard : std::uint8_t {
    idle,       ///< disarmed: only that the shaker rests
    armed,      ///< armed or in a campaign: also emergency stop, faults, the bus
    excitation  ///< from the ramp to rest: also amplitude, channels, platform
};

/// One condition as a person writes and reads it.
struct Condition {
    Trip trip = Trip::none;
    const char* name = "";
    const char* text = "";  ///< when it is not met
    Guard from = Guard::idle;
    bool fixed = false;        ///< always an abort: it cannot be taken out or made an alarm
    const char* unit = "";     ///< of the limit
    double low = 0, high = 0;  ///< of the limit; both 0: it has none
    bool below = false;        ///< the value is to stay above the limit
    [[nodiscard]] bool has_limit() const { return high > low; }
};

/// By Trip.
inline constexpr std::array<Condition, kTrips> kConditions{{
    {Trip::none, "none", "none"},
    {Trip::stale_channel, "stale_channel", "a resolver or accelerometer channel is stale",
     Guard::excitation, true},
    {Trip::stale_platform, "stale_platform",
     "the platform's status is stale: loop and fault have to come within "
     "gimbal.status_deadline_ms, changed or not",
     Guard::excitation, true},
    {Trip::loop_open, "loop_open", "stabilisation loop open", Guard::excitation, true},
    {Trip::platform_fault, "platform_fault", "platform fault", Guard::excitation, true},
    {Trip::over_amplitude, "over_amplitude", "table acceleration above the shaker's limit",
     Guard::armed, true},
    {Trip::emergency_stop, "emergency_stop", "emergency-stop chain open", Guard::armed, true},
    {Trip::shaker_fault, "shaker_fault", "shaker fault", Guard::armed, true},
    {Trip::uncommanded, "uncommanded",
     "the shaker runs, or the table moves, without being commanded", Guard::idle, true},
    {Trip::can_lost, "can_lost", "CAN bus lost", Guard::armed, true},
    {Trip::amplitude_off, "amplitude_off_command", "amplitude off command", Guard::excitation,
     false, "dB", 0.05, 20},
    {Trip::frame_loss, "frame_loss", "samples lost or incomplete", Guard::excitation, false, "%",
     0.01, 100},
    {Trip::gimbal_off, "gimbal_not_in_position", "a gimbal is not where it was commanded",
     Guard::excitation, false, "deg", 0.01, 180},
    {Trip::cross_axis, "cross_axis_motion", "motion across the vertical", Guard::excitation, false,
     "of the motion along it", 0.001, 10},
    {Trip::tilt, "tilt", "the platform has tilted since the excitation began", Guard::excitation,
     false, "deg", 0.01, 180},
    {Trip::temperature, "temperature", "platform temperature", Guard::idle, false, "degC", -50,
     200},
    {Trip::filter_divergence, "filter_divergence",
     "innovations of the filter per degree of freedom", Guard::excitation, false, "", 1, 1e6},
    {Trip::read_back, "read_back_mismatch", "a shaker register does not read back as written",
     Guard::armed, false},
    {Trip::shaker_lost, "shaker_link_lost", "no valid read-back from the shaker", Guard::armed,
     false},
    {Trip::disk, "disk", "free space for results", Guard::idle, false, "MB", 1, 1e7, true},
    {Trip::recording, "recording_degraded", "the disk refuses, or what is to be recorded waits"},
    {Trip::server, "server_stuck", "the status server makes no progress"},
    {Trip::amplitude_witness, "amplitude_witness",
     "an accelerometer disagrees with the commanded amplitude", Guard::excitation, true},
    {Trip::over_armed, "over_armed_level", "amplitude above the armed level", Guard::excitation,
     true},
    {Trip::stuck, "stuck", "an accelerometer does not move that should", Guard::excitation, true},
    {Trip::stop_disobeyed, "stop_disobeyed",
     "a stop was not obeyed in its time: press the emergency stop", Guard::idle, true},
    {Trip::watchdog_changed, "watchdog_changed",
     "the controller's watchdog timeout is not what was written", Guard::armed, true},
    {Trip::guard_lost, "guard_lost",
     "vibrig-guard is not heard, sees no accelerometer or does not reach the shaker", Guard::armed},
    {Trip::guard_stop, "guard_stop", "vibrig-guard has stopped the shaker", Guard::idle, true},
    {Trip::horn, "annunciator_silent", "horn or lamp do not read back as commanded"},
    {Trip::wrong_vibration, "wrong_vibration",
     "the accelerometers do not show the vibration that was asked for", Guard::excitation, true},
    {Trip::abort_bands, "abort_bands",
     "the controller plays random vibration without abort bands of its own", Guard::excitation,
     true},
    {Trip::motion_in_step, "motion_in_step",
     "motion in step with the vibration has grown since the loop check", Guard::excitation, false,
     "times what it found", 3, 1000},
    {Trip::cross_growth, "cross_axis_growth",
     "motion across the vertical has grown since the loop check", Guard::excitation, false,
     "times what it found", 3, 1000},
}};
[[nodiscard]] constexpr const Condition& condition_of(Trip trip) noexcept {
    return kConditions[static_cast<std::size_t>(trip)];
}

enum class Reaction : std::uint8_t { off, alarm, abort };

/// One row of the table. An abort latches always, an alarm if `latched`.
struct Rule {
    std::string name;  ///< under which it is acknowledged
    Trip condition = Trip::none;
    Reaction reaction = Reaction::abort;
    double limit = 0;
    double dwell_s = 0;  ///< not met for so long
    bool latched = false;
};
inline constexpr std::size_t kMostRules = 64;

/// The fixed conditions abort at once; bands and slow conditions warn before they abort.
[[nodiscard]] inline std::vector<Rule> default_interlock() {
    std::vector<Rule> rules;
    for (const Condition& condition : kConditions) {
        if (condition.fixed) {
            rules.push_back({condition.name, condition.trip, Reaction::abort, 0, 0, true});
        }
    }
    const auto add = [&rules](const char* name, Trip trip, Reaction reaction, double limit,
                              double dwell_s, bool latched) {
        rules.push_back({name, trip, reaction, limit, dwell_s, latched});
    };
    add("amplitude_alarm", Trip::amplitude_off, Reaction::alarm, 0.3, 1, false);
    add("amplitude_abort", Trip::amplitude_off, Reaction::abort, 1, 0.5, true);
    add("frame_loss_alarm", Trip::frame_loss, Reaction::alarm, 1, 0, false);
    add("frame_loss_abort", Trip::frame_loss, Reaction::abort, 50, 5, true);
    add("gimbal_not_in_position", Trip::gimbal_off, Reaction::abort, 10, 0.5, true);
    add("cross_axis_alarm", Trip::cross_axis, Reaction::alarm, 0.2, 2, false);
    add("cross_axis_abort", Trip::cross_axis, Reaction::abort, 1, 2, true);
    add("motion_in_step", Trip::motion_in_step, Reaction::alarm, 3, 0, false);
    add("cross_axis_growth", Trip::cross_growth, Reaction::alarm, 3, 0, false);
    add("tilt", Trip::tilt, Reaction::abort, 10, 1, true);
    add("temperature_alarm", Trip::temperature, Reaction::alarm, 75, 5, false);
    add("temperature_abort", Trip::temperature, Reaction::abort, 90, 5, true);
    add("filter_divergence", Trip::filter_divergence, Reaction::alarm, 10, 10, false);
    add("read_back_mismatch", Trip::read_back, Reaction::abort, 0, 0, true);
    add("shaker_link_lost", Trip::shaker_lost, Reaction::alarm, 0, 0, false);
    add("disk", Trip::disk, Reaction::alarm, 200, 0, false);
    add("recording_degraded", Trip::recording, Reaction::alarm, 0, 0, false);
    add("server_stuck", Trip::server, Reaction::alarm, 0, 0, false);
    add("guard_lost", Trip::guard_lost, Reaction::alarm, 0, 0, false);
    add("annunciator_silent", Trip::horn, Reaction::alarm, 0, 0, false);
    return rules;
}

}  // namespace vibrig::rt
