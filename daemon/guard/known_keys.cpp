#include "daemon/guard/known_keys.hpp"

#include <sstream>
#include <utility>

namespace vibrig::guard {

namespace {

/// Table, and the names in it.
constexpr std::pair<const char*, const char*> kByTable[] = {
    {"accelerometer", "bandwidth_hz order range_g response skew_ms"},
    {"can", "join_deadline_ms stale_deadline_ms"},
    {"can.signals",
     "azimuth azimuth_valid command_echo fault gyros_at_speed "
     "in_position inner inner_valid loop_closed message_sync_signal "
     "outer outer_valid ready slewing sync_count temperature "
     "temperature_case temperature_gyro_x temperature_gyro_y "
     "temperature_gyro_z"},
    {"commission",
     "buttons certificate enforce folder linear_sigma opening_check "
     "stop_s valid_days"},
    {"shaker",
     "backoff_max_ms backoff_min_ms baud device plate poll_period_ms "
     "response_timeout_ms watchdog_period_ms"},
    {"shaker.limits", "displacement_mm velocity_mps"},
    {"site", "azimuth_deg elevation_deg latitude_deg"},
    {"spectrum",
     "controller_gain controller_psd elastic_beyond highest_hz mode "
     "sweep_begins_s sweep_rate_tolerance tolerance_deg_h"},
    {"vibration", "frequency_hz level_window_s"},
};

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
    static const std::set<std::string> all = [] {
        std::set<std::string> names;
        for (const auto& [table, list] : kByTable) {
            std::istringstream words(list);
            for (std::string name; words >> name;) names.insert(table + ("." + name));
        }
        return registers(std::move(names));
    }();
    return all;
}

const std::set<std::string>& tables_of_the_daemon() {
    static const std::set<std::string> names{
        "archive", "campaign",  "drift",  "estimator", "gimbal",      "instrument", "interlock",
        "journal", "levelling", "log",    "mqtt",      "noise",       "platform",   "profile",
        "record",  "selftest",  "server", "threads",   "uncertainty", "unit",       "zeroing"};
    return names;
}

}  // namespace vibrig::guard
