#include <optional>
#include <utility>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/register_roles.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using Keys = std::vector<Key>;
using proto::Access;
using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using proto::ShakerRegisters;
using proto::WordOrder;

std::vector<Key> link_keys() {
    using L = campaign::Settings;
    using R = rt::RestSettings;
    using S = drivers::ShakerSettings;
    using Transport = S::Transport;
    using Unit = C::AmplitudeUnit;
    const auto link = part(&C::shaker);
    const auto limits = part(&C::campaign);
    const auto rest = part(&C::campaign, &L::rest);
    return {
        choice<Transport>("shaker.transport", link(&S::transport),
                          {{"tcp", Transport::tcp}, {"rtu", Transport::rtu}},
                          "Modbus over TCP or over a serial line"),
        text("shaker.host", link(&S::host), "a host", "tcp: the shaker controller", host_rule),
        integer("shaker.port", link(&S::port), "", 1, 65'535, "tcp: its port"),
        text("shaker.device", link(&S::device), "a path", "rtu: serial device", path_rule),
        integer("shaker.baud", link(&S::baud), "bit/s", 300, 4'000'000, "rtu: speed, 8E1"),
        integer("shaker.unit", link(&S::unit), "", 1, 255, "Modbus unit (slave) id"),
        milliseconds("shaker.response_timeout_ms", link(&S::response_timeout), {10, 60'000},
                     "of one request; on a real rig 1000 at most, 500 over rtu"),
        milliseconds("shaker.poll_period_ms", link(&S::poll_period), {10, 60'000},
                     "between read-backs"),
        milliseconds("shaker.watchdog_period_ms", link(&S::watchdog_period), {10, 60'000},
                     "between feeds of the controller's watchdog; 1000 at most, three of them are "
                     "its timeout"),
        milliseconds("shaker.backoff_min_ms", link(&S::backoff_min), {10, 60'000},
                     "before the first reconnect, doubled each time; 1000 at most"),
        milliseconds("shaker.backoff_max_ms", link(&S::backoff_max), {10, 600'000},
                     "longest wait before a reconnect"),
        text("shaker.plate", at(&C::shaker_plate), "at most 120 bytes",
             "maker, type and serial number on the controller's plate, of one that does not say "
             "them by function 17; the commissioning record stands on it",
             short_text_rule),
        choice<Unit>(
            "shaker.amplitude_unit", at(&C::amplitude_unit),
            {{"g_peak", Unit::g_peak}, {"g_rms", Unit::g_rms}, {"mps2_peak", Unit::mps2_peak}},
            "what amplitude and measured_amplitude count in, after their scale"),
        number("shaker.stop_deadline_s", limits(&L::stop, &campaign::StopSettings::deadline_s), "s",
               {safety::kLeastStopDeadline_s, safety::kMostStopDeadline_s},
               "from the order to stop to rest measured at table and controller; the platform "
               "rings down longer"),
        number("shaker.rest_g", rest(&R::limit_g), "g", {1e-6, safety::kMoving_g},
               "at rest: rms of the accelerometers below; 6 noise.accelerometer_g at least"),
        number("shaker.rest_window_s", rest(&R::window_s), "s", {0.1, 10},
               "of that rms; 8 samples at least, where they come slower; 1 s, or half of it, "
               "below stop_deadline_s"),

        number("shaker.limits.acceleration_g", limits(&L::max_acceleration_g), "g", {0.001, 1000},
               "largest peak acceleration at the table"),
        number("shaker.limits.velocity_mps", limits(&L::max_velocity_mps), "m/s", {0.001, 1000},
               "largest peak velocity at the table"),
        number("shaker.limits.displacement_mm", limits(&L::max_displacement_mm), "mm",
               {0.001, 10'000}, "largest peak displacement at the table"),
    };
}

/// Of the register that `where` finds in the configuration.
template <class Where>
Keys register_keys(const std::string& role, const std::string& unit, const std::string& doc,
                   Where where) {
    const std::string name = "shaker.registers." + role;
    const auto of = [where](auto Register::*member) {
        return [ where, member ](C & c) -> auto& { return where(c).*member; };
    };
    std::vector<std::pair<std::string, RegisterType>> types;
    for (const RegisterTypeRow& row : kRegisterTypes)
        types.emplace_back(row.word, static_cast<RegisterType>(types.size()));
    return {
        integer(name + ".address", of(&Register::address), "", 0, 65'535,
                "first register, from 0 as on the wire; " + doc),
        choice<RegisterType>(name + ".type", of(&Register::type), types, "what the registers hold"),
        choice<WordOrder>(name + ".word_order", of(&Register::order),
                          {{"big", WordOrder::big}, {"little", WordOrder::little}},
                          "big: high word first"),
        choice<RegisterTable>(
            name + ".table", of(&Register::table),
            {{"holding", RegisterTable::holding}, {"input", RegisterTable::input}}, "Modbus table"),
        choice<Access>(
            name + ".access", of(&Register::access),
            {{"read", Access::read}, {"write", Access::write}, {"read_write", Access::read_write}},
            "what the controller allows"),
        number(name + ".scale", of(&Register::scale), unit, {1e-12, 1e12}, "value of one count"),
        integer(name + ".mask", of(&Register::mask), "", 1, 65'535,
                "bits: the value is 1 if any of these is set"),
    };
}

/// Leaves the keys out of --check unless `shown` says that there is something to them.
Keys shown_where(bool (*shown)(const ShakerRegisters&), Keys keys) {
    for (Key& key : keys)
        key.write = [write = std::move(key.write), shown](C& c) {
            return shown(c.shaker.registers) ? write(c) : std::string();
        };
    return keys;
}

Keys watchdog_keys() {
    const auto read = [](const Entry& entry, C& c) {
        const auto* value = entry.node.as_boolean();
        if (value == nullptr) {
            entry.refuse("a table (the register) or false (none)");
        } else if (!value->get()) {
            c.shaker.registers.watchdog.reset();
        }
    };
    return joined(
        {shown_where([](const ShakerRegisters& map) { return !map.watchdog; },
                     {{"shaker.registers.watchdog", "boolean or table", "", "false or a register",
                       "false: the controller has none, and vibrigd refuses to run", read,
                       [](C&) { return std::string("false"); }, R"({"const":false})"}}),
         shown_where([](const ShakerRegisters& map) { return map.watchdog.has_value(); },
                     register_keys(
                         "watchdog", "", "any changed value feeds it",
                         [](C & c) -> auto& { return *c.shaker.registers.watchdog; }))});
}

/// What a controller has or has not: what states a part of it has it.
template <class T>
T& made(std::optional<T>& part) {
    return part ? *part : part.emplace();
}

/// Of one that says what it measured, too.
Keys psd_keys() {
    const auto block = [](auto proto::PsdBlock::*member) {
        return [member](C & c) -> auto& {
            return made(made(c.shaker.registers.random).psd_block).*member;
        };
    };
    return shown_where(
        [](const ShakerRegisters& map) { return map.random && map.random->psd_block; },
        joined(
            {register_keys("psd_block", "g^2/Hz",
                           "what was measured at the table in the last random dwell, and is kept "
                           "until the next one: Hz and g^2/Hz of each line, pairs of f32",
                           block(&proto::PsdBlock::first)),
             {integer("shaker.registers.psd_block.pairs", block(&proto::PsdBlock::pairs), "", 2,
                      1000,
                      "of Hz and g^2/Hz that there is room for; what is not used is 0 at the end"),
              integer("shaker.registers.psd_block.attempts", block(&proto::PsdBlock::attempts), "",
                      1, 5, "how often it is tried after each random dwell")}}));
}

/// Of a controller that plays random vibration too.
Keys random_keys() {
    using R = proto::RandomRegisters;
    const auto of = [](Register R::*member) {
        return [member](C & c) -> auto& { return made(c.shaker.registers.random).*member; };
    };
    return shown_where(
        [](const ShakerRegisters& map) { return map.random.has_value(); },
        joined(
            {register_keys("profile_number", "", "of the profile that the controller is to play",
                           of(&R::profile_number)),
             register_keys("profile_level_db", "dB", "level about the profile; a type with a sign",
                           of(&R::profile_level_db)),
             register_keys("profile_checksum", "",
                           "CRC-32 of the profile in force, over Hz and g^2/Hz of each point as "
                           "big-endian floats",
                           of(&R::profile_checksum)),
             register_keys("measured_g_rms", "g", "measured rms at the table",
                           of(&R::measured_g_rms)),
             register_keys("control_state", "",
                           "low four bits 0 idle, 1 levelling, 2 at level, 3 aborted; 0x10: its "
                           "abort bands are armed; high byte: why it aborted",
                           of(&R::control_state))}));
}

/// Of a controller that sweeps: likewise.
Keys sweep_keys() {
    using S = proto::SweepRegisters;
    const auto of = [](Register S::*member) {
        return [member](C & c) -> auto& { return made(c.shaker.registers.sweep).*member; };
    };
    return shown_where(
        [](const ShakerRegisters& map) { return map.sweep.has_value(); },
        joined(
            {register_keys("sweep_from", "Hz",
                           "where a sweep begins; for plans with sweeps, as the three that follow",
                           of(&S::from)),
             register_keys("sweep_to", "Hz", "where it ends, and stays", of(&S::to)),
             register_keys("sweep_rate", "octaves/min", "how fast it goes, either way",
                           of(&S::rate)),
             register_keys("actual_frequency", "Hz", "where it is; read",
                           of(&S::actual_frequency))}));
}

}  // namespace

std::vector<Key> shaker_keys() {
    using S = ShakerRegisters;
    const auto of = part(&C::shaker, &drivers::ShakerSettings::registers);
    return joined(
        {link_keys(),
         register_keys("frequency", "Hz", "set-point of the frequency", of(&S::frequency)),
         register_keys("amplitude", "amplitude_unit", "set-point of the amplitude at the table",
                       of(&S::amplitude)),
         register_keys("ramp_time", "s", "time of a ramp", of(&S::ramp_time)),
         register_keys("run", "", "1 runs, 0 stops", of(&S::run)), watchdog_keys(),
         register_keys("watchdog_timeout", "s", "the controller stops when not fed so long",
                       of(&S::watchdog_timeout)),
         register_keys("state", "", "0 idle, 1 ramping, 2 running, 3 stopping, 4 fault",
                       of(&S::state)),
         register_keys("fault", "", "fault bits", of(&S::fault)),
         register_keys("emergency_stop", "", "1: the chain is open", of(&S::emergency_stop)),
         register_keys("measured_amplitude", "amplitude_unit", "measured amplitude at the table",
                       of(&S::measured_amplitude)),
         // Which of the two, or neither.
         shown_where(
             [](const S& map) { return map.random || map.sweep; },
             register_keys("mode", "",
                           "0 sine, 1 random, 2 sweep; with registers of profiles or sweeps",
                           of(&S::mode))),
         random_keys(), psd_keys(), sweep_keys()});
}

}  // namespace vibrig::configuration
