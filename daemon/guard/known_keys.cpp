#include "daemon/guard/known_keys.hpp"

namespace vibrig::guard {

namespace {

std::set<std::string> registers(std::set<std::string> names) {
    const std::string table = "shaker.registers.";
    for (const char* role :
         {"frequency", "amplitude", "watchdog", "watchdog_timeout", "state", "fault",
          "emergency_stop", "mode", "profile_number", "profile_level_db", "profile_checksum",
          "measured_g_rms", "control_state", "psd_block", "sweep_from", "sweep_to", "sweep_rate",
          "actual_frequency"})
        for (const char* field :
             {"address", "type", "word_order", "table", "access", "scale", "mask"})
            names.insert(table + role + "." + field);
    for (const char* role : {"ramp_time", "run", "measured_amplitude"})
        names.insert(table + role + ".access");
    for (const char* field : {"pairs", "attempts"}) names.insert(table + "psd_block." + field);
    names.insert(table + "watchdog");  // false: there is none
    return names;
}

}  // namespace

const std::set<std::string>& keys_of_the_daemon() {
    static const std::set<std::string> names = registers({
        "accelerometer.bandwidth_hz",
        "accelerometer.order",
        "accelerometer.range_g",
        "accelerometer.response",
        "accelerometer.skew_ms",
        "can.join_deadline_ms",
        "can.samples_per_frame",
        "can.signals.azimuth",
        "can.signals.azimuth_valid",
        "can.signals.command_echo",
        "can.signals.fault",
        "can.signals.gyros_at_speed",
        "can.signals.in_position",
        "can.signals.inner",
        "can.signals.inner_valid",
        "can.signals.loop_closed",
        "can.signals.message_sync_signal",
        "can.signals.outer",
        "can.signals.outer_valid",
        "can.signals.ready",
        "can.signals.slewing",
        "can.signals.sync_count",
        "can.signals.temperature",
        "can.signals.temperature_case",
        "can.signals.temperature_gyro_x",
        "can.signals.temperature_gyro_y",
        "can.signals.temperature_gyro_z",
        "can.stale_deadline_ms",
        "commission.buttons",
        "commission.certificate",
        "commission.enforce",
        "commission.folder",
        "commission.linear_sigma",
        "commission.opening_check",
        "commission.stop_s",
        "commission.valid_days",
        "shaker.backoff_max_ms",
        "shaker.backoff_min_ms",
        "shaker.baud",
        "shaker.device",
        "shaker.limits.displacement_mm",
        "shaker.limits.velocity_mps",
        "shaker.plate",
        "shaker.poll_period_ms",
        "shaker.response_timeout_ms",
        "shaker.watchdog_period_ms",
        "site.azimuth_deg",
        "site.elevation_deg",
        "site.latitude_deg",
        "spectrum.controller_gain",
        "spectrum.controller_psd",
        "spectrum.elastic_beyond",
        "spectrum.highest_hz",
        "spectrum.mode",
        "spectrum.pads_damping",
        "spectrum.sweep_begins_s",
        "spectrum.sweep_rate_tolerance",
        "spectrum.tolerance_deg_h",
        "spectrum.transmission",
        "vibration.frequency_hz",
        "vibration.level_window_s",
    });
    return names;
}

const std::set<std::string>& tables_of_the_daemon() {
    static const std::set<std::string> names{
        "archive", "campaign",  "drift",  "estimator", "gimbal",      "instrument", "interlock",
        "journal", "levelling", "log",    "mqtt",      "noise",       "platform",   "profile",
        "record",  "selftest",  "server", "threads",   "uncertainty", "unit",       "zeroing"};
    return names;
}

}  // namespace vibrig::guard
