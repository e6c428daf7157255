#include <array>
#include <initializer_list>
#include <optional>
#include <utility>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using drivers::ShakerSettings;
using proto::Access;
using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using proto::ShakerRegisters;
using proto::WordOrder;

void add_link_keys(std::vector<Key>& keys) {
    using Transport = ShakerSettings::Transport;
    keys.push_back(choice<Transport>(
        "shaker.transport", {{"tcp", Transport::tcp}, {"rtu", Transport::rtu}},
        "Modbus over TCP or over a serial line",
        [](C & c) -> auto& { return c.shaker.transport; }));
    keys.push_back(text(
        "shaker.host", "a host", "tcp: the shaker controller", host_rule,
        [](C & c) -> auto& { return c.shaker.host; }));
    keys.push_back(integer("shaker.port", "", 1, 65'535, "tcp: its port",
                           [](C& c) -> int& { return c.shaker.port; }));
    keys.push_back(text(
        "shaker.device", "a path", "rtu: serial device", path_rule,
        [](C & c) -> auto& { return c.shaker.device; }));
    keys.push_back(integer("shaker.baud", "bit/s", 300, 4'000'000, "rtu: speed, 8E1",
                           [](C& c) -> int& { return c.shaker.baud; }));
    keys.push_back(integer("shaker.unit", "", 1, 255, "Modbus unit (slave) id",
                           [](C& c) -> int& { return c.shaker.unit; }));
    keys.push_back(milliseconds(
        "shaker.response_timeout_ms", {10, 60'000}, "of one request",
        [](C & c) -> auto& { return c.shaker.response_timeout; }));
    keys.push_back(milliseconds(
        "shaker.poll_period_ms", {10, 60'000}, "between read-backs",
        [](C & c) -> auto& { return c.shaker.poll_period; }));
    keys.push_back(milliseconds(
        "shaker.watchdog_period_ms", {10, 60'000},
        "between feeds of the controller's watchdog; 1000 at most, three of them are its timeout",
        [](C & c) -> auto& { return c.shaker.watchdog_period; }));
    keys.push_back(milliseconds(
        "shaker.backoff_min_ms", {10, 60'000}, "before the first reconnect, doubled each time",
        [](C & c) -> auto& { return c.shaker.backoff_min; }));
    keys.push_back(milliseconds(
        "shaker.backoff_max_ms", {10, 600'000}, "longest wait before a reconnect",
        [](C & c) -> auto& { return c.shaker.backoff_max; }));
    keys.push_back(text(
        "shaker.plate", "at most 120 bytes",
        "maker, type and serial number on the controller's plate, of one that does not say them by "
        "function 17; the commissioning record stands on it",
        short_text_rule, [](C & c) -> auto& { return c.shaker_plate; }));
    using Unit = C::AmplitudeUnit;
    keys.push_back(choice<Unit>(
        "shaker.amplitude_unit",
        {{"g_peak", Unit::g_peak}, {"g_rms", Unit::g_rms}, {"mps2_peak", Unit::mps2_peak}},
        "what amplitude and measured_amplitude count in, after their scale",
        [](C& c) -> Unit& { return c.amplitude_unit; }));
    keys.push_back(number("shaker.stop_deadline_s", "s",
                          {safety::kLeastStopDeadline_s, safety::kMostStopDeadline_s},
                          "from the order to stop to rest measured at table and controller; the "
                          "platform rings down longer",
                          [](C& c) -> double& { return c.campaign.stop.deadline_s; }));
    keys.push_back(number("shaker.rest_g", "g", {1e-6, safety::kMoving_g},
                          "at rest: rms of the accelerometers below; 6 noise.accelerometer_g at "
                          "least",
                          [](C& c) -> double& { return c.campaign.rest.limit_g; }));
    keys.push_back(number("shaker.rest_window_s", "s", {0.1, 10},
                          "of that rms; 8 samples at least, where they come slower",
                          [](C& c) -> double& { return c.campaign.rest.window_s; }));

    keys.push_back(number("shaker.limits.acceleration_g", "g", {0.001, 1000},
                          "largest peak acceleration at the table",
                          [](C& c) -> double& { return c.campaign.max_acceleration_g; }));
    keys.push_back(number("shaker.limits.velocity_mps", "m/s", {0.001, 1000},
                          "largest peak velocity at the table",
                          [](C& c) -> double& { return c.campaign.max_velocity_mps; }));
    keys.push_back(number("shaker.limits.displacement_mm", "mm", {0.001, 10'000},
                          "largest peak displacement at the table",
                          [](C& c) -> double& { return c.campaign.max_displacement_mm; }));
}

void add_register_keys(std::vector<Key>& keys, const std::string& role, const std::string& unit,
                       const std::string& doc, const At<Register>& at) {
    const std::string name = "shaker.registers." + role;
    keys.push_back(integer(
        name + ".address", "", 0, 65'535, "first register, from 0 as on the wire; " + doc,
        [at](C& c) { return static_cast<int>(at(c).address); },
        [at](C& c, int value) { at(c).address = static_cast<std::uint16_t>(value); }));
    keys.push_back(choice<RegisterType>(
        name + ".type",
        {{"u16", RegisterType::u16},
         {"i16", RegisterType::i16},
         {"u32", RegisterType::u32},
         {"i32", RegisterType::i32},
         {"f32", RegisterType::f32},
         {"bits", RegisterType::bits}},
        "what the registers hold", [at](C & c) -> auto& { return at(c).type; }));
    keys.push_back(choice<WordOrder>(
        name + ".word_order", {{"big", WordOrder::big}, {"little", WordOrder::little}},
        "big: high word first", [at](C & c) -> auto& { return at(c).order; }));
    keys.push_back(choice<RegisterTable>(
        name + ".table", {{"holding", RegisterTable::holding}, {"input", RegisterTable::input}},
        "Modbus table", [at](C & c) -> auto& { return at(c).table; }));
    keys.push_back(choice<Access>(
        name + ".access",
        {{"read", Access::read}, {"write", Access::write}, {"read_write", Access::read_write}},
        "what the controller allows", [at](C & c) -> auto& { return at(c).access; }));
    keys.push_back(number(name + ".scale", unit, {1e-12, 1e12}, "value of one count",
                          [at](C& c) -> double& { return at(c).scale; }));
    keys.push_back(integer(
        name + ".mask", "", 1, 65'535, "bits: the value is 1 if any of these is set",
        [at](C& c) { return static_cast<int>(at(c).mask); },
        [at](C& c, int value) { at(c).mask = static_cast<std::uint16_t>(value); }));
}

/// Leaves the keys from `first` on out of --check while `shown` says that there is nothing to them.
void show_only(std::vector<Key>& keys, std::size_t first, bool (*shown)(const ShakerRegisters&)) {
    for (std::size_t i = first; i < keys.size(); ++i)
        keys[i].write = [write = std::move(keys[i].write), shown](C& c) {
            return shown(c.shaker.registers) ? write(c) : std::string();
        };
}

void add_watchdog_keys(std::vector<Key>& keys) {
    const std::size_t none = keys.size();
    keys.push_back({"shaker.registers.watchdog", "boolean or table", "", "false or a register",
                    "false: the controller has none, and vibrigd refuses to run",
                    [](const toml::node& node, C& c, Problems& problems) {
                        const auto* value = node.as_boolean();
                        if (value == nullptr) {
                            problems.add(place_of(node.source()), "shaker.registers.watchdog",
                                         describe(node), "a table (the register) or false (none)");
                        } else if (!value->get()) {
                            c.shaker.registers.watchdog.reset();
                        }
                    },
                    [](C&) { return std::string("false"); }, R"({"const":false})"});
    show_only(keys, none, [](const ShakerRegisters& map) { return !map.watchdog; });
    const std::size_t first = keys.size();
    add_register_keys(keys, "watchdog", "", "any changed value feeds it",
                      [](C& c) -> Register& { return *c.shaker.registers.watchdog; });
    show_only(keys, first, [](const ShakerRegisters& map) { return map.watchdog.has_value(); });
}

/// What a controller has or has not: what states a part of it has it.
template <class T>
T& made(std::optional<T>& part) {
    return part ? *part : part.emplace();
}

/// Of one that says what it measured, too.
void add_psd_keys(std::vector<Key>& keys) {
    const std::size_t first = keys.size();
    const auto block = [](C& c) -> proto::PsdBlock& {
        return made(made(c.shaker.registers.random).psd_block);
    };
    add_register_keys(keys, "psd_block", "g^2/Hz",
                      "what was measured at the table in the last random dwell, and is kept until "
                      "the next one: Hz and g^2/Hz of each line, pairs of f32",
                      [block](C& c) -> Register& { return block(c).first; });
    keys.push_back(integer("shaker.registers.psd_block.pairs", "", 2, 1000,
                           "of Hz and g^2/Hz that there is room for; what is not used is 0 at the "
                           "end",
                           [block](C& c) -> int& { return block(c).pairs; }));
    keys.push_back(integer("shaker.registers.psd_block.attempts", "", 1, 5,
                           "how often it is tried after each random dwell",
                           [block](C& c) -> int& { return block(c).attempts; }));
    show_only(keys, first,
              [](const ShakerRegisters& map) { return map.random && map.random->psd_block; });
}

template <class Registers>
struct Role {
    const char *name, *unit, *doc;
    Register Registers::*member;
};

/// Registers of which a controller has all or none.
template <class Registers>
void add_group(std::vector<Key>& keys, std::optional<Registers> ShakerRegisters::*group,
               std::initializer_list<Role<Registers>> roles) {
    for (const Role<Registers>& role : roles)
        add_register_keys(keys, role.name, role.unit, role.doc,
                          [group, member = role.member](C& c) -> Register& {
                              return made(c.shaker.registers.*group).*member;
                          });
}

/// Of a controller that plays random vibration too.
void add_random_keys(std::vector<Key>& keys) {
    using proto::RandomRegisters;
    const std::size_t first = keys.size();
    add_group<RandomRegisters>(
        keys, &ShakerRegisters::random,
        {{"profile_number", "", "of the profile that the controller is to play",
          &RandomRegisters::profile_number},
         {"profile_level_db", "dB", "level about the profile; a type with a sign",
          &RandomRegisters::profile_level_db},
         {"profile_checksum", "",
          "CRC-32 of the profile in force, over Hz and g^2/Hz of each point as big-endian floats",
          &RandomRegisters::profile_checksum},
         {"measured_g_rms", "g", "measured rms at the table", &RandomRegisters::measured_g_rms},
         {"control_state", "",
          "low four bits 0 idle, 1 levelling, 2 at level, 3 aborted; 0x10: its abort bands are "
          "armed; high byte: why it aborted",
          &RandomRegisters::control_state}});
    show_only(keys, first, [](const ShakerRegisters& map) { return map.random.has_value(); });
    add_psd_keys(keys);
}

/// Of a controller that sweeps: likewise.
void add_sweep_keys(std::vector<Key>& keys) {
    using proto::SweepRegisters;
    const std::size_t first = keys.size();
    add_group<SweepRegisters>(
        keys, &ShakerRegisters::sweep,
        {{"sweep_from", "Hz",
          "where a sweep begins; for plans with sweeps, as the three that follow",
          &SweepRegisters::from},
         {"sweep_to", "Hz", "where it ends, and stays", &SweepRegisters::to},
         {"sweep_rate", "octaves/min", "how fast it goes, either way", &SweepRegisters::rate},
         {"actual_frequency", "Hz", "where it is; read", &SweepRegisters::actual_frequency}});
    show_only(keys, first, [](const ShakerRegisters& map) { return map.sweep.has_value(); });
}

/// Which of the two, or neither.
void add_mode_keys(std::vector<Key>& keys) {
    const std::size_t first = keys.size();
    add_register_keys(keys, "mode", "",
                      "0 sine, 1 random, 2 sweep; with registers of profiles or sweeps",
                      [](C& c) -> Register& { return c.shaker.registers.mode; });
    show_only(keys, first, [](const ShakerRegisters& map) { return map.random || map.sweep; });
}

}  // namespace

void add_shaker_keys(std::vector<Key>& keys) {
    const auto add = [&keys](const char* role, const char* unit, const char* doc,
                             Register ShakerRegisters::*member) {
        add_register_keys(keys, role, unit, doc,
                          [member](C& c) -> Register& { return c.shaker.registers.*member; });
    };
    add_link_keys(keys);
    add("frequency", "Hz", "set-point of the frequency", &ShakerRegisters::frequency);
    add("amplitude", "amplitude_unit", "set-point of the amplitude at the table",
        &ShakerRegisters::amplitude);
    add("ramp_time", "s", "time of a ramp", &ShakerRegisters::ramp_time);
    add("run", "", "1 runs, 0 stops", &ShakerRegisters::run);
    add_watchdog_keys(keys);
    add("watchdog_timeout", "s", "the controller stops when not fed so long",
        &ShakerRegisters::watchdog_timeout);
    add("state", "", "0 idle, 1 ramping, 2 running, 3 stopping, 4 fault", &ShakerRegisters::state);
    add("fault", "", "fault bits", &ShakerRegisters::fault);
    add("emergency_stop", "", "1: the chain is open", &ShakerRegisters::emergency_stop);
    add("measured_amplitude", "amplitude_unit", "measured amplitude at the table",
        &ShakerRegisters::measured_amplitude);
    add_mode_keys(keys);
    add_random_keys(keys);
    add_sweep_keys(keys);
}

}  // namespace vibrig::configuration
