#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "daemon/configuration/cross_checks.hpp"
#include "daemon/configuration/register_roles.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

using proto::Access;
using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;

// How near to what is asked for a register has to come. The campaign reads frequencies back as near
// (Excitation::chosen, SweepReading::is); a level is recorded as it was asked for.
constexpr double kWritten_hz = 1e-3, kSweepEnd_hz = 9e-3, kWritten_db = 1e-3;

}  // namespace

std::vector<RegisterRole> roles_of(const proto::ShakerRegisters& r) {
    std::vector<RegisterRole> roles{{"frequency", &r.frequency, true, true},
                                    {"amplitude", &r.amplitude, true, true},
                                    {"ramp_time", &r.ramp_time, true, true},
                                    {"run", &r.run, true, false},
                                    {"watchdog_timeout", &r.watchdog_timeout, true, true},
                                    {"state", &r.state, false, false},
                                    {"fault", &r.fault, false, false},
                                    {"emergency_stop", &r.emergency_stop, false, false},
                                    {"measured_amplitude", &r.measured_amplitude, false, true}};
    if (r.watchdog) roles.push_back({"watchdog", &*r.watchdog, true, false});
    if (const auto& random = r.random)
        roles.insert(roles.end(), {{"profile_number", &random->profile_number, true, false},
                                   {"profile_level_db", &random->profile_level_db, true, true},
                                   {"profile_checksum", &random->profile_checksum, false, false},
                                   {"measured_g_rms", &random->measured_g_rms, false, true},
                                   {"control_state", &random->control_state, false, false}});
    if (r.random && r.random->psd_block)
        roles.push_back({"psd_block", &r.random->psd_block->first, false, true});
    if (const auto& sweep = r.sweep)
        roles.insert(roles.end(), {{"sweep_from", &sweep->from, true, true},
                                   {"sweep_to", &sweep->to, true, true},
                                   {"sweep_rate", &sweep->rate, true, true},
                                   {"actual_frequency", &sweep->actual_frequency, false, true}});
    if (r.random || r.sweep) roles.push_back({"mode", &r.mode, true, false});
    return roles;
}

void CrossCheck::registers() {
    if (!sound({"shaker.registers"})) {
        return;
    }
    for (const RegisterRole& role : roles_of(c_.shaker.registers)) {
        const std::string key = std::string("shaker.registers.") + role.name;
        const Register& reg = *role.reg;
        if (reg.address + reg.words() > 65'536) {
            refuse({key + ".address", key + ".type"}, std::to_string(reg.address) + " for 2 words",
                   "65534 at most");
        }
        if (role.written && reg.table == RegisterTable::input) {
            refuse({key + ".table"}, "\"input\"",
                   "\"holding\": this register is written, input registers cannot be");
        }
        if (role.written && reg.access == Access::read) {
            refuse({key + ".access"}, "\"read\"", "\"write\" or \"read_write\": it is written");
        }
        if (!role.written && reg.access == Access::write) {
            refuse({key + ".access"}, "\"write\"", "\"read\" or \"read_write\": it is read");
        }
        const bool quantity = role.reg == &c_.shaker.registers.frequency ||
                              role.reg == &c_.shaker.registers.amplitude ||
                              role.reg == &c_.shaker.registers.ramp_time ||
                              role.reg == &c_.shaker.registers.watchdog_timeout ||
                              role.reg == &c_.shaker.registers.measured_amplitude;
        if (quantity && reg.type == RegisterType::bits) {
            refuse({key + ".type"}, "\"bits\"", "a number: u16, i16, u32, i32 or f32");
        }
    }
    writable_registers_apart();
    random_registers();
    sweep_registers();
}

/// All of them or none: what is not read back cannot be played.
void CrossCheck::random_registers() {
    const auto& random = c_.shaker.registers.random;
    if (!random) return;
    for (const char* role : {"mode", "profile_number", "profile_level_db", "profile_checksum",
                             "measured_g_rms", "control_state"}) {
        const std::string key = std::string("shaker.registers.") + role + ".address";
        if (!places_.contains(key))
            problems_.add({}, key, "nothing",
                          "an address: random vibration needs mode, profile_number, "
                          "profile_level_db, profile_checksum, measured_g_rms and control_state");
    }
    const auto type_of = [this](const char* role, const Register& reg, bool good,
                                const char* expected) {
        if (good) return;
        const std::string key = std::string("shaker.registers.") + role;
        refuse({key + ".type", key + ".address"}, row_of(reg.type).word, expected);
    };
    using enum RegisterType;
    const RegisterType level = random->profile_level_db.type;
    type_of("profile_level_db", random->profile_level_db,
            level == i16 || level == i32 || level == f32,
            "i16, i32 or f32: levels are below 0 too");
    type_of("profile_checksum", random->profile_checksum, random->profile_checksum.type == u32,
            "u32");
    for (const auto& [role, reg] : {std::pair{"mode", &c_.shaker.registers.mode},
                                    std::pair{"profile_number", &random->profile_number},
                                    std::pair{"control_state", &random->control_state}})
        type_of(role, *reg, reg->type == u16 || reg->type == u32, "u16 or u32");
    if (random->psd_block) psd_block(*random->psd_block);
    type_of("measured_g_rms", random->measured_g_rms, random->measured_g_rms.type != bits,
            "a number");
}

/// Of one that is stated: where it is, and that all of it is there.
void CrossCheck::psd_block(const proto::PsdBlock& block) {
    const std::string key = "shaker.registers.psd_block";
    if (!places_.contains(key + ".address"))
        problems_.add({}, key + ".address", "nothing", "an address: of the first pair");
    if (block.first.type != RegisterType::f32)
        refuse({key + ".type", key + ".address"}, row_of(block.first.type).word,
               "f32: pairs of floats");
    if (const int end = block.first.address + 4 * block.pairs; end > 65'536)
        refuse({key + ".pairs", key + ".address"},
               std::to_string(block.pairs) + " pairs from " + std::to_string(block.first.address),
               std::to_string((65'536 - block.first.address) / 4) + " pairs of 4 words at most");
}

/// Likewise.
void CrossCheck::sweep_registers() {
    const auto& sweep = c_.shaker.registers.sweep;
    if (!sweep) return;
    for (const char* role : {"mode", "sweep_from", "sweep_to", "sweep_rate", "actual_frequency"}) {
        const std::string key = std::string("shaker.registers.") + role + ".address";
        if (!places_.contains(key))
            problems_.add({}, key, "nothing",
                          "an address: sweeps need mode, sweep_from, sweep_to, sweep_rate and "
                          "actual_frequency");
    }
    for (const auto& [role, reg] :
         {std::pair{"mode", &c_.shaker.registers.mode}, std::pair{"sweep_from", &sweep->from},
          std::pair{"sweep_to", &sweep->to}, std::pair{"sweep_rate", &sweep->rate},
          std::pair{"actual_frequency", &sweep->actual_frequency}}) {
        const std::string key = std::string("shaker.registers.") + role;
        if (reg->type == RegisterType::bits)
            refuse({key + ".type", key + ".address"}, row_of(reg->type).word, "a number");
    }
}

void CrossCheck::writable_registers_apart() {
    const std::vector<RegisterRole> roles = roles_of(c_.shaker.registers);
    for (std::size_t i = 0; i < roles.size(); ++i) {
        for (std::size_t j = i + 1; j < roles.size(); ++j) {
            const Register& a = *roles[i].reg;
            const Register& b = *roles[j].reg;
            const bool apart = a.table != b.table || a.address + a.words() <= b.address ||
                               b.address + b.words() <= a.address;
            // What is only read may share a register (state and its bits); what is written must
            // not.
            if (apart || !(roles[i].written || roles[j].written)) {
                continue;
            }
            const std::string first = std::string("shaker.registers.") + roles[i].name;
            const std::string second = std::string("shaker.registers.") + roles[j].name;
            refuse({second + ".address", first + ".address", second + ".type", first + ".type"},
                   std::string(roles[j].name) + " at " + std::to_string(b.address) + " over " +
                       roles[i].name + " at " + std::to_string(a.address),
                   "written registers that do not overlap");
        }
    }
}

void CrossCheck::set_points_fit() {
    if (!sound({"shaker.registers", "shaker.amplitude_unit", "site.gravity_mps2"})) {
        return;
    }
    const proto::ShakerRegisters& r = c_.shaker.registers;
    if (sound({"campaign.table_g"}) && c_.campaign.stops.empty()) {
        held(r.amplitude, "amplitude",
             {*std::max_element(c_.campaign.table_g.begin(), c_.campaign.table_g.end()), "g"},
             "campaign.table_g");
    }
    if (sound({"vibration.frequency_hz"})) {
        held(r.frequency, "frequency", {c_.estimator.frequency_hz, "Hz", kWritten_hz},
             "vibration.frequency_hz");
    }
    if (sound({"campaign.ramp_s"})) {
        held(r.ramp_time, "ramp_time", {c_.campaign.ramp_s, "s"}, "campaign.ramp_s");
    }
    if (sound({"shaker.watchdog_period_ms"})) watchdog_timeout_fits();
    if (sound({"campaign.plan"})) set_points_of_plan_fit();
}

/// As the register holds it: rounded to 0 it is no watchdog, to more than its longest a late one,
/// and one below the feeds' period stops every campaign.
void CrossCheck::watchdog_timeout_fits() {
    const Register& reg = c_.shaker.registers.watchdog_timeout;
    const double period_s = drivers::to_seconds(c_.shaker.watchdog_period);
    std::array<std::uint16_t, 2> words{};
    const auto raw = std::span(words).first(reg.words());
    // What does not fit at all, the driver refuses.
    if (reg.access == Access::read || reg.type == RegisterType::bits ||
        !proto::encode(reg, 3 * period_s, raw))
        return;
    const double held_s = proto::decode(reg, raw);
    const double longest_s = drivers::to_seconds(drivers::kLongestWatchdogTimeout);
    if (held_s > period_s && held_s <= longest_s) return;
    refuse({"shaker.registers.watchdog_timeout.type", "shaker.registers.watchdog_timeout.scale",
            "shaker.watchdog_period_ms"},
           rounded(3 * period_s) + " s to be written, which the register holds as " +
               rounded(held_s) + " s",
           "more than " + rounded(period_s) + " s, the feeds' period, and " + plain(longest_s) +
               " s at most");
}

void CrossCheck::set_points_of_plan_fit() {
    const proto::ShakerRegisters& r = c_.shaker.registers;
    for (std::size_t i = 0; i < c_.campaign.stops.size(); ++i) {
        const auto& stop = c_.campaign.stops[i];
        const std::string dwell = "dwell " + std::to_string(i + 1) + ": ";
        const auto check = [&](const Register& reg, const char* role, const SetPoint& value) {
            held(reg, role, value, "campaign.plan", dwell);
        };
        if (stop.random) {
            if (r.random)
                check(r.random->profile_level_db, "profile_level_db",
                      {stop.random->set_point.level_db, "dB", kWritten_db});
            continue;
        }
        check(r.amplitude, "amplitude", {stop.table_g, "g"});
        if (stop.frequency_hz > 0)
            check(r.frequency, "frequency", {stop.frequency_hz, "Hz", kWritten_hz});
        if (!stop.sweep.any() || !r.sweep) continue;
        check(r.sweep->from, "sweep_from", {stop.sweep.from_hz, "Hz", kSweepEnd_hz});
        check(r.sweep->to, "sweep_to", {stop.sweep.to_hz, "Hz", kSweepEnd_hz});
    }
}

void CrossCheck::held(const Register& reg, const std::string& role, const SetPoint& value,
                      const char* from, const std::string& where) {
    const std::string key = "shaker.registers." + role;
    const auto blame = [&](const std::string& expected) {
        refuse({key + ".type", key + ".scale", from},
               where + plain(value.value) + " " + value.unit + " to be written", expected);
    };
    const double most = row_of(reg.type).largest * reg.scale;
    if (std::abs(value.value) > most)
        return blame("a register that holds it (" + rounded(most) + " " + value.unit + " at most)");
    if (reg.type == RegisterType::f32) return;
    const double written = std::round(value.value / reg.scale) * reg.scale;
    if (std::abs(written - value.value) > value.near)
        blame("a multiple of " + plain(reg.scale) + " " + value.unit + ", the step of " + key);
}

}  // namespace vibrig::configuration
