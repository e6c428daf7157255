#include "daemon/configuration/cross_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <system_error>
#include <utility>

#include "daemon/configuration/value.hpp"
#include "estimator/uncertainty/inputs_check.hpp"

namespace vibrig::configuration {

namespace {

bool loopback(const std::string& host) {
    const bool dotted = std::all_of(host.begin(), host.end(),
                                    [](char ch) { return ch == '.' || (ch >= '0' && ch <= '9'); });
    return host == "localhost" || host == "::1" || (dotted && host.starts_with("127."));
}

}  // namespace

double isolator_resonance_hz(double frequency_hz, double transmission) {
    return transmission < 1 ? frequency_hz / std::sqrt(1 + 1 / transmission) : 0;
}

bool CrossCheck::sound(std::initializer_list<const char*> keys) const {
    return std::none_of(keys.begin(), keys.end(),
                        [this](const char* key) { return problems_.concern(key); });
}

void CrossCheck::refuse(std::initializer_list<std::string> keys, const std::string& found,
                        const std::string& expected) {
    for (const std::string& key : keys) {
        if (const auto place = places_.find(key); place != places_.end()) {
            problems_.add(place->second, key, found, expected);
            return;
        }
    }
    problems_.add({}, *keys.begin(), found + " (default)", expected);
}

void CrossCheck::everywhere() {
    bus();
    inputs();
    mount();
    response();
    if (sound({"shaker.backoff_min_ms", "shaker.backoff_max_ms"}) &&
        c_.shaker.backoff_min > c_.shaker.backoff_max) {
        refuse({"shaker.backoff_min_ms", "shaker.backoff_max_ms"},
               "backoff_min_ms above backoff_max_ms", "backoff_min_ms <= backoff_max_ms");
    }
    if (sound({"shaker.unit"}) && c_.shaker.unit > 247 && c_.shaker.unit != 255) {
        refuse({"shaker.unit"}, std::to_string(c_.shaker.unit), "1 to 247, or 255 (Modbus/TCP)");
    }
    registers();
}

void CrossCheck::temperature() {
    const auto& of = c_.campaign;
    const std::string window = plain(of.temperature_window_s);
    if (sound({"campaign.temperature_window_s", "campaign.ready_timeout_s"}) &&
        of.temperature_window_s >= of.ready_timeout_s)
        refuse(
            {"campaign.temperature_window_s", "campaign.ready_timeout_s"},
            "temperature_window_s " + window + " with ready_timeout_s " + plain(of.ready_timeout_s),
            "a window shorter than the timeout");
    if (sound({"campaign.temperature_window_s", "can.signals.temperature"}) &&
        of.temperature_window_s > 0 && c_.assembler.bindings.temperature.empty())
        refuse({"campaign.temperature_window_s"}, window + " with no can.signals.temperature",
               "0 where no temperature is known");
}

void CrossCheck::for_daemon() {
    rig_clock();
    simulated_rig();
    if (!c_.simulated()) real_rig();
    status_signals();
    if (!c_.shaker.registers.watchdog) {
        refuse({"shaker.registers.watchdog"}, "no watchdog register",
               "one that vibrigd feeds: a dead daemon must mean a stopped shaker");
    }
    if (sound({"shaker.watchdog_period_ms"}) &&
        c_.shaker.watchdog_period > drivers::kLongestWatchdogPeriod) {
        const double period_ms = static_cast<double>(c_.shaker.watchdog_period) / 1e6;
        refuse({"shaker.watchdog_period_ms"},
               plain(period_ms) + " ms, so that the table would shake on for " +
                   rounded(3e-3 * period_ms) + " s after a daemon that died",
               "1000 ms at most: three of them are the controller's timeout, 3 s at most");
    }
    if (sound({"shaker.poll_period_ms"}) && c_.shaker.poll_period > drivers::kLongestPollPeriod) {
        refuse({"shaker.poll_period_ms"},
               plain(static_cast<double>(c_.shaker.poll_period) / 1e6) +
                   " ms, so that an open emergency-stop chain would be seen as late as that",
               "500 ms at most");
    }
    if (sound({"shaker.registers"}) &&
        c_.shaker.registers.watchdog_timeout.access == proto::Access::write) {
        refuse(
            {"shaker.registers.watchdog_timeout.access"}, "\"write\"",
            "\"read_write\": what the controller's watchdog waits for is read back all the time");
    }
    const bool serial = c_.shaker.transport == drivers::ShakerSettings::Transport::rtu;
    if (sound({"shaker.transport", "shaker.device"}) && serial && c_.shaker.device.empty()) {
        refuse({"shaker.transport", "shaker.device"}, "\"rtu\" without shaker.device",
               "the serial device, such as \"/dev/ttyUSB0\"");
    }
    if (sound({"shaker.transport", "shaker.unit"}) && serial && c_.shaker.unit > 247) {
        refuse({"shaker.unit"}, std::to_string(c_.shaker.unit), "1 to 247 on a serial line");
    }
    temperature();
    doors();
    broker();
    onlookers();
    archiving();
    adaptive();
    rest();
    stops_in_time();
    seconds_of_samples();
    set_points_fit();
    limits();
    frequency();
    mode();
    profiles();
    frequencies_of_plan();
    travel();
}

void CrossCheck::travel() {
    if (!sound({"gimbal.travel_deg", "campaign.positions_deg", "campaign.plan"})) return;
    const bool listed = c_.campaign.stops.empty();
    std::size_t n = listed ? c_.campaign.positions_deg.size() : c_.campaign.stops.size();
    if (c_.campaign.adaptive) n = 0;  // chooses within the travel
    for (std::size_t p = 0; p < n; ++p) {
        const auto& at = listed ? c_.campaign.positions_deg[p] : c_.campaign.stops[p].position_deg;
        for (std::size_t i = 0; i < 3; ++i) {
            const auto& travel = c_.gimbal.travel_deg[i];
            if (travel[1] - travel[0] >= 360 || drivers::within_travel(at[i], travel)) continue;
            refuse({listed ? "campaign.positions_deg" : "campaign.plan", "gimbal.travel_deg"},
                   "position " + std::to_string(p + 1) + " at a reading of " + rounded(at[i]) +
                       " deg of the " + std::array{"outer", "inner", "azimuth"}[i] + " gimbal",
                   plain(travel[0]) + " to " + plain(travel[1]) + " deg (gimbal.travel_deg)");
            return;
        }
    }
}

void CrossCheck::status_signals() {
    const auto& names = c_.assembler.bindings;
    if (!sound({"can.signals.ready", "can.signals.loop_closed", "can.signals.fault"})) return;
    if (names.ready.empty() && names.loop_closed.empty() && names.gyros_at_speed.empty() &&
        names.fault.empty())
        refuse({"can.signals.ready", "can.signals.loop_closed", "can.signals.fault",
                "can.signals.gyros_at_speed"},
               "none of ready, loop_closed, gyros_at_speed and fault",
               "one of them at least: a platform that says nothing of itself is never ready, and "
               "its faults are never seen");
}

void CrossCheck::rest() {
    if (!sound({"shaker.rest_g", "noise.accelerometer_g"})) return;
    const double least = 6 * c_.estimator.accelerometer_g;
    if (c_.campaign.rest.limit_g < least) {
        refuse({"shaker.rest_g", "noise.accelerometer_g"}, plain(c_.campaign.rest.limit_g) + " g",
               rounded(least) + " g at least, 6 sigma of noise.accelerometer_g: noise must not " +
                   "look like motion");
    }
}

void CrossCheck::doors() {
    const auto& server = c_.server;
    if (sound({"server.page"}) && !server.page.empty()) {
        std::string host = server.page.substr(0, server.page.rfind(':'));
        if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
        if (!loopback(host))
            refuse({"server.page"}, '"' + server.page + '"',
                   "this machine's loopback, \"127.0.0.1:PORT\" or \"[::1]:PORT\": the page over "
                   "plain HTTP is for nobody else");
    }
    if (sound({"server.remote"}) && !server.remote.empty()) {
        using Row = std::pair<const char*, std::string>;
        for (const auto& [key, value] :
             {Row{"server.certificate", server.certificate}, Row{"server.key", server.key},
              Row{"server.clients_ca", server.clients_ca}}) {
            if (value.empty())
                refuse({"server.remote"}, '"' + server.remote + "\" without " + key,
                       "a file in PEM; `vibrig pki init` makes one");
        }
    }
}

void CrossCheck::broker() {
    const MqttSettings& mqtt = c_.mqtt;
    if (!sound({"mqtt.host", "mqtt.tls"}) || mqtt.host.empty()) return;
    if (!mqtt.tls && !loopback(mqtt.host)) {
        refuse({"mqtt.tls", "mqtt.host"}, "false with the broker at " + mqtt.host,
               "true, or a broker on this machine, such as \"127.0.0.1\"");
    }
    if (mqtt.certificate.empty() != mqtt.key.empty()) {
        refuse({"mqtt.certificate", "mqtt.key"}, "one of mqtt.certificate and mqtt.key",
               "both or none");
    }
    if (mqtt.username.empty() && !mqtt.password_file.empty()) {
        refuse({"mqtt.password_file"}, "a password without mqtt.username", "both or none");
    }
}

void CrossCheck::onlookers() {
    if (sound({"guard.socket", "shaker.transport"}) && !c_.guard_socket.empty() &&
        c_.shaker.transport == drivers::ShakerSettings::Transport::rtu) {
        refuse({"guard.socket"}, '"' + c_.guard_socket + "\" with the shaker on a serial line",
               "shaker.transport \"tcp\": a serial line has one master, so that the guard could "
               "not stop the shaker");
    }
    const auto& horn = c_.annunciator.horn;
    if (sound({"annunciator.modbus.unit"}) && horn.unit > 247 && horn.unit != 255) {
        refuse({"annunciator.modbus.unit"}, std::to_string(horn.unit),
               "1 to 247, or 255 (Modbus/TCP)");
    }
    // Whoever names a coil believes that there is a horn.
    for (const char* key : {"annunciator.modbus.port", "annunciator.modbus.unit",
                            "annunciator.modbus.horn_coil", "annunciator.modbus.lamp_coil"}) {
        if (!horn.host.empty() || !places_.contains(key)) continue;
        refuse({key}, "it without annunciator.modbus.host",
               "the device's host as well: without it there is neither horn nor lamp");
        break;
    }
    if (sound({"annunciator.modbus.horn_coil", "annunciator.modbus.lamp_coil"}) &&
        horn.horn_coil == horn.lamp_coil) {
        refuse({"annunciator.modbus.lamp_coil", "annunciator.modbus.horn_coil"},
               std::to_string(horn.lamp_coil) + " for horn and lamp", "two coils, or -1: no lamp");
    }
}

void CrossCheck::archiving() {
    if (!sound({"archive.folder", "archive.index", "record.enabled"})) return;
    if (c_.archive.folder.empty() && !c_.archive.index.empty())
        refuse({"archive.index"}, '"' + c_.archive.index + "\" without archive.folder",
               "the archive's folder as well: without it nothing is delivered");
    if (!c_.archive.folder.empty() && !c_.record.enabled)
        refuse({"archive.folder", "record.enabled"}, "an archive with record.enabled = false",
               "true: what is not recorded cannot be delivered");
}

void CrossCheck::adaptive() {
    if (sound({"campaign.prior", "campaign.adaptive"}) && c_.campaign.type_prior) {
        const char* const missing = !c_.campaign.adaptive            ? "campaign.adaptive = true"
                                    : c_.archive.folder.empty()      ? "archive.folder"
                                    : c_.paperwork.unit_type.empty() ? "unit.type"
                                                                     : nullptr;
        if (missing != nullptr)
            refuse({"campaign.prior"}, "\"type\"", std::string(missing) + " with it");
    }
    if (!sound({"campaign.adaptive"}) || !c_.campaign.adaptive) return;
    if (!c_.campaign.plan.empty()) {
        refuse({"campaign.adaptive", "campaign.plan"}, "an adaptive campaign with a plan file",
               "one of them");
    }
    if (!(c_.campaign.target_bias > 0 || c_.campaign.target_linear > 0 ||
          c_.campaign.target_quadratic > 0)) {
        refuse({"campaign.adaptive"}, "true without campaign.targets",
               "a target for bias, linear or quadratic terms");
    }
    if (c_.campaign.on_not_valid == campaign::OnNotValid::repeat) {
        refuse({"campaign.adaptive", "campaign.on_not_valid"}, "true with \"repeat\"",
               "\"go-on\" or \"pause\": an adaptive campaign chooses what it repeats");
    }
    if (c_.estimator.method != estimator::Method::joint) {
        refuse({"campaign.adaptive", "estimator.method"}, "true with the two-step route",
               "estimator.method \"joint\"");
    }
}

void CrossCheck::inputs() {
    if (!sound({"uncertainty.correlation"})) return;
    try {
        estimator::uncertainty::check(c_.estimator.uncertainty);
    } catch (const estimator::SettingsError& error) {
        const std::string text = error.what();
        const auto found = text.find("found "), expected = text.find(", expected ");
        refuse({"uncertainty.correlation"}, text.substr(found + 6, expected - found - 6),
               text.substr(expected + 11));
    }
}

void CrossCheck::bus() {
    if (sound({"can.port", "can.path"}) &&
        c_.can.kind == drivers::CanPortSettings::Kind::seqpacket && c_.can.path.empty()) {
        refuse({"can.port", "can.path"}, "\"seqpacket\" without can.path",
               "can.path, the Unix socket to connect to");
    }
    if (sound({"can.join_deadline_ms", "can.stale_deadline_ms"}) &&
        c_.assembler.stale_deadline <= c_.assembler.join_deadline) {
        refuse({"can.stale_deadline_ms", "can.join_deadline_ms"},
               "stale_deadline_ms not above join_deadline_ms",
               "a channel to be stale after samples are joined");
    }
    if (sound({"can.sample_rate_hz", "can.stale_deadline_ms"}) &&
        c_.assembler.stale_deadline <= c_.assembler.sample_period) {
        refuse(
            {"can.stale_deadline_ms", "can.sample_rate_hz"},
            "stale_deadline_ms of " + plain(drivers::to_seconds(c_.assembler.stale_deadline) * 1e3),
            "more than one sample period, " +
                rounded(drivers::to_seconds(c_.assembler.sample_period) * 1e3) + " ms");
    }
}

bool is_hardware(const std::string& interface, const std::string& folder) {
    std::error_code ignored;
    return std::filesystem::exists(std::filesystem::path(folder) / interface / "device", ignored);
}

void CrossCheck::simulated_rig() {
    if (!c_.commission.simulated || !sound({"commission.simulated"})) return;
    // A switch that takes a demand away must not be set on a rig that can hurt: vcan alone is no
    // proof, since gateways use it; a controller on this machine is a program.
    const bool serial = c_.shaker.transport == drivers::ShakerSettings::Transport::rtu;
    const bool here = serial ? c_.shaker.device.starts_with("/dev/pts/") : loopback(c_.shaker.host);
    if (sound({"can.port", "can.interface"}) &&
        c_.can.kind == drivers::CanPortSettings::Kind::socketcan && is_hardware(c_.can.interface)) {
        // A gateway on this machine may lead to a real controller.
        refuse({"commission.simulated"},
               "true on the CAN interface " + c_.can.interface + ", which is a device",
               "can.port \"seqpacket\" or a virtual interface");
    }
    if (sound({"shaker.host", "shaker.transport", "shaker.device"}) && !here) {
        refuse({"commission.simulated"},
               "true with the shaker on " + (serial ? c_.shaker.device : c_.shaker.host),
               "shaker.host on loopback, or shaker.device below /dev/pts/");
    }
}

void CrossCheck::rig_clock() {
    if (!sound({"clock.source"}) || c_.clock != Configuration::ClockKind::rig) return;
    // The rig's clock stands still when the bus is silent: deadlines and watchdogs would never fire
    // on real hardware.
    const bool simulated_bus = c_.can.kind == drivers::CanPortSettings::Kind::seqpacket ||
                               c_.can.interface.starts_with("vcan") ||
                               c_.can.interface.starts_with("vxcan");
    if (sound({"can.port", "can.interface"}) && !simulated_bus) {
        refuse({"clock.source"}, "\"rig\" on the CAN interface " + c_.can.interface,
               "can.port \"seqpacket\" or an interface named vcan* or vxcan*");
    }
    const bool serial = c_.shaker.transport == drivers::ShakerSettings::Transport::rtu;
    if (sound({"shaker.host", "shaker.transport"}) && (serial || !loopback(c_.shaker.host))) {
        refuse({"clock.source"},
               "\"rig\" with the shaker on " + (serial ? "a serial line" : c_.shaker.host),
               "shaker.host on loopback, such as \"127.0.0.1\"");
    }
}

void CrossCheck::limits() {
    if (!sound({"vibration.frequency_hz", "site.gravity_mps2", "shaker.limits"})) {
        return;
    }
    if (!sound({"campaign.table_g", "campaign.plan"})) return;
    // Each level at its frequency, once.
    struct Asked {
        double g, hz;
        std::size_t dwell = 0;  ///< of the plan, from 1; 0: by campaign.table_g
    };
    std::vector<Asked> asked;
    for (const auto& stop : c_.campaign.stops) {
        // A profile's peaks are its own, and a sweep is looked at all along it.
        if (stop.random || stop.sweep.any()) continue;
        const double hz = stop.frequency_hz > 0 ? stop.frequency_hz : c_.estimator.frequency_hz;
        const auto dwell = static_cast<std::size_t>(&stop - c_.campaign.stops.data()) + 1;
        if (std::ranges::none_of(
                asked, [&](const Asked& one) { return one.g == stop.table_g && one.hz == hz; }))
            asked.push_back({stop.table_g, hz, dwell});
    }
    if (asked.empty()) {
        for (const double g : c_.campaign.table_g) asked.push_back({g, c_.estimator.frequency_hz});
    }
    for (const Asked& one : asked) {
        const double a = one.g, f = one.hz;
        const std::size_t dwell = one.dwell;
        const double omega = 2 * std::numbers::pi * f;
        const double mps2 = a * c_.estimator.gravity_mps2;
        const std::string found = (dwell > 0 ? "dwell " + std::to_string(dwell) + " with " : "") +
                                  plain(a) + " g at " + plain(f) + " Hz";
        const auto check = [&](double value, double limit, const char* unit, const char* key) {
            if (value > limit) {
                refuse({dwell > 0 ? "campaign.plan" : "campaign.table_g", "vibration.frequency_hz",
                        key},
                       found + ", that is " + rounded(value) + " " + unit + " peak",
                       rounded(limit) + " " + unit + " at most (" + key + ")");
            }
        };
        check(a, c_.campaign.max_acceleration_g, "g", "shaker.limits.acceleration_g");
        check(mps2 / omega, c_.campaign.max_velocity_mps, "m/s", "shaker.limits.velocity_mps");
        check(mps2 / (omega * omega) * 1e3, c_.campaign.max_displacement_mm, "mm",
              "shaker.limits.displacement_mm");
    }
}

}  // namespace vibrig::configuration
