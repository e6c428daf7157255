// What goes into a recording beside the samples.
#include <spdlog/spdlog.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "daemon/app/parts.hpp"
#include "daemon/version.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "proto/text.hpp"

namespace vibrig {

using drivers::Time;

namespace {

constexpr std::size_t kLargestDbc = 16 << 20;

std::string dbc_text(const std::string& path) {
    return path.empty() ? std::string(proto::rig_dbc_text())
                        : proto::read_whole_file(path, kLargestDbc);
}

std::string plan_json(const campaign::Settings& settings) {
    nlohmann::ordered_json runs = nlohmann::ordered_json::array();
    const auto add = [&runs](const std::array<double, 3>& position_deg, double table_g) {
        runs.push_back({{"position", position_deg}, {"table_g", table_g}});
    };
    for (const auto& stop : settings.stops) add(stop.position_deg, stop.table_g);
    if (settings.stops.empty() && !settings.adaptive) {
        const std::size_t positions = settings.positions_deg.size();
        for (std::size_t i = 0; i < settings.table_g.size() * positions; ++i) {
            const std::size_t at = settings.sequence.empty() ? i : settings.sequence[i];
            add(settings.positions_deg[at % positions], settings.table_g[at / positions]);
        }
    }
    return nlohmann::ordered_json{
        {"adaptive", settings.adaptive}, {"dwell_s", settings.dwell_s}, {"runs", runs}}
        .dump();
}

std::string interlock_table(const rt::Interlock& interlock) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < interlock.rows(); ++i) {
        const rt::Rule& rule = *interlock.row(i).rule;
        const auto& condition = rt::condition_of(rule.condition);
        rows.push_back({{"name", rule.name},
                        {"condition", condition.name},
                        {"reaction", rule.reaction == rt::Reaction::abort ? "abort" : "alarm"},
                        {"limit", condition.has_limit() ? nlohmann::ordered_json(rule.limit)
                                                        : nlohmann::ordered_json(nullptr)},
                        {"unit", condition.unit},
                        {"dwell_s", rule.dwell_s}});
    }
    return rows.dump();
}

}  // namespace

record::ConditionRow conditions(const Parts& parts, double command_g, double command_hz) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    // Each comes once a second.
    constexpr Time kSensorDeadline = 5 * drivers::kSecond;
    record::ConditionRow row;
    row.time = parts.clock.now();
    const auto platform = parts.acquisition.view().platform;
    const auto fresh = [&](Time time, Time deadline) {
        return time != 0 && row.time - time <= deadline;
    };
    const auto flag = [](bool set) { return static_cast<std::int8_t>(set ? 1 : 0); };
    const Time deadline = parts.configuration.gimbal.status_deadline;
    row.temperature_c = fresh(platform.time, deadline) ? platform.temperature_c : kNone;
    for (std::size_t i = 0; i < platform.sensor_c.size(); ++i)
        row.sensor_c[i] =
            fresh(platform.sensor_time[i], kSensorDeadline) ? platform.sensor_c[i] : kNone;
    if (fresh(platform.time, deadline)) {
        row.ready = flag(platform.ready);
        row.loop_closed = flag(platform.loop_closed);
        row.gyros_at_speed = flag(platform.gyros_at_speed);
        row.fault = flag(platform.fault);
    }
    if (fresh(platform.gimbal_time, deadline)) {
        row.in_position = flag(platform.in_position);
        row.slewing = flag(platform.slewing);
    }
    row.command_g = command_g;
    row.command_hz = command_hz;
    const auto shaker = parts.shaker->reading();
    row.set_point_g = shaker.valid ? shaker.amplitude_g : kNone;
    row.set_point_hz = shaker.valid ? shaker.frequency_hz : kNone;
    row.measured_g = shaker.valid ? shaker.measured_g : kNone;
    if (shaker.valid) {
        row.shaker_state = shaker.state;
        row.shaker_running = flag(shaker.running);
        row.emergency_stop_open = flag(shaker.emergency_stop_open);
    }
    const auto seen = parts.interlock.seen_g();
    row.witness_platform_g = seen[0] < 0 ? kNone : seen[0];
    row.witness_table_g = seen[1] < 0 ? kNone : seen[1];
    for (std::size_t i = 0; i < parts.interlock.rows(); ++i) {
        const auto state = parts.interlock.row(i);
        row.interlock_value.push_back(state.present);
        row.interlock_raised.push_back(state.raised ? 1 : 0);
    }
    return row;
}

record::Head recording_head(Parts& parts, const std::string& by, std::size_t dwells_before) {
    const std::int64_t utc_ns = utc_now();
    record::Head head;
    head.name = parts.configuration.campaign.name;
    head.started_by = by;
    head.utc_ns = utc_ns;
    head.utc_offset_ns =
        (utc_ns - parts.clock.now()) / drivers::kMicrosecond * drivers::kMicrosecond;
    head.clock = parts.rig_clock ? "rig" : "real";
    head.simulated = parts.configuration.simulated();
    head.version = kVersion;
    head.compiler = estimator::compiler();
    head.instruction_set = estimator::instruction_set();
    head.configuration = configuration::format_effective(parts.loaded);
    head.configuration_hash =
        fmt::format("{:016x}", journal::configuration_hash(result_configuration(parts.loaded)));
    try {
        head.dbc = dbc_text(parts.configuration.dbc);
    } catch (const std::exception& error) {
        parts.events.log(Severity::warning, "recorder",
                         parts.configuration.dbc + ": " + error.what());
    }
    head.proof = parts.campaign.proofs_json();
    head.plan = plan_json(parts.configuration.campaign);
    head.interface =
        parts.configuration.can.kind == drivers::CanPortSettings::Kind::socketcan ? parts.configuration.can.interface : "vcan0";
    head.interlocks = interlock_table(parts.interlock);
    head.interlock_rows = parts.interlock.rows();
    head.restart = dwells_before > 0;
    head.dwells_before = dwells_before;
    return head;
}

}  // namespace vibrig
