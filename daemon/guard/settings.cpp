#include "daemon/guard/settings.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "daemon/guard/keys.hpp"
#include "daemon/guard/known_keys.hpp"
#include "proto/sample_rate.hpp"

namespace vibrig::guard {

namespace {

/// A path of sun_path, or a name in the abstract space.
bool is_socket(const std::string& path) {
    return path.size() > 1 && path.size() <= 107 && (path.front() == '/' || path.front() == '@');
}

proto::Register read_register(Keys& keys, const std::string& role, proto::Register reg) {
    const std::string name = "shaker.registers." + role + ".";
    reg.address =
        static_cast<std::uint16_t>(keys.integer(name + "address", reg.address, 0, 65'535));
    reg.type = static_cast<proto::RegisterType>(
        keys.choice(name + "type", static_cast<std::size_t>(reg.type),
                    {"u16", "i16", "u32", "i32", "f32", "bits"}));
    reg.order = static_cast<proto::WordOrder>(
        keys.choice(name + "word_order", static_cast<std::size_t>(reg.order), {"big", "little"}));
    reg.table = static_cast<proto::RegisterTable>(
        keys.choice(name + "table", static_cast<std::size_t>(reg.table), {"holding", "input"}));
    reg.scale = keys.number(name + "scale", reg.scale, 1e-12, 1e12);
    reg.mask = static_cast<std::uint16_t>(keys.integer(name + "mask", reg.mask, 1, 65'535));
    return reg;
}

/// What would be written to a controller that is not Vibrig's own must not be Vibrig's own map.
void insist_on_registers(Keys& keys, bool rig_time) {
    if (keys.boolean("commission.simulated", false) || rig_time) return;
    for (const char* key :
         {"shaker.registers.run.address", "shaker.registers.run.type",
          "shaker.registers.measured_amplitude.address", "shaker.registers.measured_amplitude.type",
          "shaker.registers.measured_amplitude.scale", "shaker.registers.ramp_time.address",
          "shaker.registers.ramp_time.type", "shaker.registers.ramp_time.scale"})
        if (!keys.stated(key))
            keys.refuse(key, "nothing",
                        "it stated: Vibrig's own map is for the simulated rig only");
}

void read_shaker(Keys& keys, Settings& s) {
    if (keys.choice("shaker.transport", 0, {"tcp", "rtu"}) == 1)
        keys.refuse("shaker.transport", "\"rtu\"",
                    "\"tcp\": a serial line has one master, and that is vibrigd; the guard needs a "
                    "controller (or a gateway) that both reach over TCP");
    s.shaker.host = keys.text("shaker.host", s.shaker.host);
    s.shaker.host_place = keys.place("shaker.host");
    if (s.shaker.host.empty()) keys.refuse("shaker.host", "\"\"", "a host");
    s.shaker.port = keys.integer("shaker.port", s.shaker.port, 1, 65'535);
    s.shaker.unit = keys.integer("shaker.unit", s.shaker.unit, 1, 255);
    if (s.shaker.unit > 247 && s.shaker.unit != 255)
        keys.refuse("shaker.unit", std::to_string(s.shaker.unit), "1 to 247, or 255 (Modbus/TCP)");
    const proto::ShakerRegisters defaults;
    s.shaker.ramp_time = read_register(keys, "ramp_time", defaults.ramp_time);
    s.shaker.run = read_register(keys, "run", defaults.run);
    for (const auto& [role, reg] :
         {std::pair("ramp_time", s.shaker.ramp_time), {"run", s.shaker.run}})
        if (reg.table != proto::RegisterTable::holding)
            keys.refuse(std::string("shaker.registers.") + role + ".table", "\"input\"",
                        "\"holding\": the guard has to write it");
    s.shaker.measured_amplitude =
        read_register(keys, "measured_amplitude", defaults.measured_amplitude);
    const double gravity = keys.number("site.gravity_mps2", 9.80665, 9.7, 9.9);
    const auto unit = keys.choice("shaker.amplitude_unit", 0, {"g_peak", "g_rms", "mps2_peak"});
    const std::array<double, 3> to_g_peak{1, std::numbers::sqrt2, 1 / gravity};
    s.shaker.measured_amplitude.scale *= to_g_peak[unit];
    s.judge.limit_g = keys.number("shaker.limits.acceleration_g", s.judge.limit_g, 0.001, 1000);
    s.judge.stop_deadline_s =
        keys.number("shaker.stop_deadline_s", s.judge.stop_deadline_s, safety::kLeastStopDeadline_s,
                    safety::kMostStopDeadline_s);
    s.judge.rest_g = keys.number("shaker.rest_g", s.judge.rest_g, 1e-6, safety::kMoving_g);
    s.witness.window_s = keys.number("shaker.rest_window_s", s.witness.window_s, 0.1, 10);
}

/// |A| at the reference frequency. Of a plan's other frequencies it is at least 0.7 (a plan beyond
/// that is refused), so that a platform 3 dB louder than it shows is the most that can be.
double read_seen(Keys& keys, std::vector<std::array<double, 2>>& table) {
    const double hz = keys.number("vibration.frequency_hz", 15, 0.1, 2000);
    const double bandwidth = keys.number("accelerometer.bandwidth_hz", 0, 0, 100'000);
    const int order = keys.integer("accelerometer.order", 1, 1, 8);
    table = keys.pairs("accelerometer.response");
    if (bandwidth > 0) return 1 / std::sqrt(1 + std::pow(hz / bandwidth, 2 * order));
    if (table.empty()) return 1;
    // Straight on logarithmic scales; beyond the last the daemon refuses.
    if (hz <= table.front()[0]) return table.front()[1];
    for (std::size_t i = 1; i < table.size(); ++i) {
        if (hz > table[i][0]) continue;
        const double share =
            std::log(hz / table[i - 1][0]) / std::log(table[i][0] / table[i - 1][0]);
        return table[i - 1][1] * std::pow(table[i][1] / table[i - 1][1], share);
    }
    return table.back()[1];
}

/// The most that the platform can show of the armed level, over what it shows of it at the
/// reference frequency: where the mount, as the file states it, lets the most through.
double read_most_ratio(Keys& keys, const WitnessSettings& w, bool hard,
                       const std::vector<std::array<double, 2>>& response) {
    constexpr double kRounding = 1.001;
    const double damping = keys.number("spectrum.pads_damping", 0.2, 0.001, 1);
    const auto measured = keys.pairs("spectrum.transmission", "pads");
    double most = std::max(w.transmission, 1.0);
    if (!hard && measured.empty()) {
        // Of a spring with a dashpot beside it, at its peak.
        const double z = 4 * damping * damping;
        const double r2 = (std::sqrt(1 + 2 * z) - 1) / z;
        most = std::max(most, std::sqrt((1 + z * r2) / ((1 - r2) * (1 - r2) + z * r2)));
    }
    if (!hard)
        for (const auto& [hz, ratio] : measured) most = std::max(most, ratio);
    double loudest = 1;
    for (const auto& [hz, ratio] : response) loudest = std::max(loudest, ratio);
    return kRounding * most * loudest / (w.transmission * w.seen);
}

void read_witness(Keys& keys, WitnessSettings& w, double& most_ratio) {
    const auto keep_place = [&keys, &w](const std::string& key) {
        if (keys.stated(key)) w.places[key] = keys.place(key);
    };
    w.dbc = keys.text("can.dbc", w.dbc);
    keep_place("can.dbc");
    w.sample_rate_hz = keys.number("can.sample_rate_hz", kUnstatedSampleRate_hz, 1, 10'000);
    w.samples_per_frame = keys.integer("can.samples_per_frame", w.samples_per_frame, 1, 16);
    constexpr std::array<const char*, 3> kAxes{"accel_x", "accel_y", "accel_z"};
    for (std::size_t i = 0; i < 3; ++i) {
        const std::string key = std::string("can.signals.") + kAxes[i];
        w.platform[i] = keys.text(key, w.platform[i]);
        w.platform_valid[i] = keys.text(key + "_valid", w.platform_valid[i]);
        keep_place(key);
        keep_place(key + "_valid");
    }
    w.table = keys.text("can.signals.table_accel", w.table);
    keep_place("can.signals.table_accel");
    // With nothing between them it is 1, stated or not.
    const bool hard = keys.choice("spectrum.mount", 0, {"isolated", "hard"}) == 1;
    w.transmission = keys.number("vibration.transmission", hard ? 1 : w.transmission, 0.001, 10);
    std::vector<std::array<double, 2>> response;
    w.seen = read_seen(keys, response);
    most_ratio = read_most_ratio(keys, w, hard, response);
    keys.numbers("accelerometer.zero_g", w.zero_g.data(), 3);
    for (std::size_t i = 0; i < 3; ++i)
        keys.numbers("accelerometer.matrix[" + std::to_string(i) + "]", w.matrix[i].data(), 3);
    w.rig_time = keys.choice("clock.source", 0, {"real", "rig"}) == 1;
    keep_place("clock.source");
}

void read_bus(Keys& keys, drivers::CanPortSettings& can) {
    using Kind = drivers::CanPortSettings::Kind;
    can.kind = static_cast<Kind>(keys.choice("can.port", 0, {"socketcan", "seqpacket"}));
    can.interface = keys.text("can.interface", can.interface);
    can.path = keys.text("can.path", can.path);
    can.fd = keys.boolean("can.fd", can.fd);
    can.receive_buffer = keys.integer("can.receive_buffer", can.receive_buffer, 4096, 1 << 30);
    if (can.kind == Kind::seqpacket && !is_socket(can.path))
        keys.refuse("can.path", '"' + can.path + '"', "an absolute path or \"@name\"");
}

void read_alarm(Keys& keys, AlarmSettings& a) {
    a.host = keys.text("annunciator.modbus.host", a.host);
    a.port = keys.integer("annunciator.modbus.port", a.port, 1, 65'535);
    a.unit = keys.integer("annunciator.modbus.unit", a.unit, 1, 255);
    if (a.unit > 247 && a.unit != 255)
        keys.refuse("annunciator.modbus.unit", std::to_string(a.unit),
                    "1 to 247, or 255 (Modbus/TCP)");
    a.horn_coil = keys.integer("annunciator.modbus.horn_coil", a.horn_coil, 0, 65'535);
    a.lamp_coil = keys.integer("annunciator.modbus.lamp_coil", a.lamp_coil, -1, 65'535);
    if (a.lamp_coil == a.horn_coil)
        keys.refuse("annunciator.modbus.lamp_coil", std::to_string(a.lamp_coil),
                    "another coil than the horn's, or -1: none");
    a.command = keys.text("annunciator.command", a.command);
    if (!a.command.empty() && a.command.front() != '/')
        keys.refuse("annunciator.command", '"' + a.command + '"', "an absolute path, or \"\"");
    const double limit =
        keys.number("annunciator.command_limit_s", drivers::to_seconds(a.command_limit), 1, 600);
    a.command_limit = drivers::from_seconds(limit);
}

}  // namespace

std::string key_error(const std::string& key, const std::string& found,
                      const std::string& expected) {
    return key + ": found " + found + ", expected " + expected;
}

Settings parse_settings(const std::string& text, const std::string& file) {
    Keys keys(text, file);
    Settings s;
    s.witness.file = file;
    s.socket = keys.text("guard.socket", s.socket);
    if (!is_socket(s.socket))
        keys.refuse("guard.socket", '"' + s.socket + '"',
                    "an absolute path or \"@name\": vibrigd and the guard meet there");
    read_bus(keys, s.can);
    read_witness(keys, s.witness, s.judge.most_ratio);
    read_shaker(keys, s);
    insist_on_registers(keys, s.witness.rig_time);
    read_alarm(keys, s.alarm);
    keys.refuse_unknown(keys_of_the_daemon(), tables_of_the_daemon());
    if (!keys.problems().empty()) throw SettingsError(keys.problems());
    s.believed = keys.believed();
    const auto folder = std::filesystem::path(file).parent_path();
    if (!s.witness.dbc.empty() && !folder.empty())
        s.witness.dbc = (folder / s.witness.dbc).lexically_normal().string();
    return s;
}

Settings read_settings(const std::string& path) {
    std::error_code error;
    const bool folder = std::filesystem::is_directory(path, error);
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    if (folder || !file)
        throw SettingsError(path + ": found " +
                            (folder       ? "a folder"
                             : errno != 0 ? std::strerror(errno)
                                          : "nothing that can be read") +
                            ", expected vibrigd's configuration file");
    std::ostringstream text;
    text << file.rdbuf();
    return parse_settings(text.str(), path);
}

}  // namespace vibrig::guard
