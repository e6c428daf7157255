#include "drivers/shaker/shaker_image.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace vibrig::drivers {
namespace {

constexpr std::uint16_t kBandsArmed = 0x10;  ///< of control_state
constexpr std::size_t kMaxReadWords = 125;   ///< Modbus application protocol 1.1b3, 6.3

[[nodiscard]] std::uint16_t to_u16(double value) noexcept {
    return value >= 0 && value <= 65535 ? static_cast<std::uint16_t>(std::lround(value))
                                        : std::uint16_t{0xffff};
}

void check_role(const char* role, const proto::Register& reg, bool read, bool write) {
    const std::string key = std::string("shaker.registers.") + role;
    if (reg.address + reg.words() > 0x10000) {
        throw ShakerError(key + ".address: must leave room for " + std::to_string(reg.words()) +
                          " words below 65536, got " + std::to_string(reg.address));
    }
    if (!std::isfinite(reg.scale) || reg.scale == 0) {
        throw ShakerError(key + ".scale: must be finite and not 0, got " +
                          std::to_string(reg.scale));
    }
    if (write && reg.table != proto::RegisterTable::holding) {
        throw ShakerError(key + ".table: must be holding, since it is written, got input");
    }
    if (write && reg.access == proto::Access::read) {
        throw ShakerError(key + ".access: must allow writing, got read");
    }
    if (read && reg.access == proto::Access::write) {
        throw ShakerError(key + ".access: must allow reading, since it is read back, got write");
    }
}

void check_block(const proto::PsdBlock& block) {
    const std::string key = "shaker.registers.psd_block";
    check_role("psd_block", block.first, true, false);
    if (block.first.type != proto::RegisterType::f32)
        throw ShakerError(key + ".type: must be f32, pairs of floats");
    if (block.pairs < 2 || block.first.address + 4 * block.pairs > 0x10000)
        throw ShakerError(key +
                          ".pairs: must be 2 at least and leave room for 4 words each below "
                          "65536, got " +
                          std::to_string(block.pairs) + " from " +
                          std::to_string(block.first.address));
}

}  // namespace

ShakerImage::ShakerImage(const proto::ShakerRegisters& registers) : registers_(registers) {
    std::vector roles{registers.frequency,      registers.amplitude,
                      registers.ramp_time,      registers.run,
                      registers.state,          registers.fault,
                      registers.emergency_stop, registers.measured_amplitude};
    if (const auto& random = registers.random)
        roles.insert(roles.end(),
                     {random->profile_number, random->profile_level_db, random->profile_checksum,
                      random->measured_g_rms, random->control_state});
    if (const auto& sweep = registers.sweep)
        roles.insert(roles.end(), {sweep->from, sweep->to, sweep->rate, sweep->actual_frequency});
    if (registers.random || registers.sweep) roles.push_back(registers.mode);
    std::sort(roles.begin(), roles.end(), [](const auto& a, const auto& b) {
        return std::pair(a.table, a.address) < std::pair(b.table, b.address);
    });
    for (const auto& reg : roles) {
        const std::size_t end = reg.address + reg.words();
        if (!ranges_.empty()) {
            RegisterRange& last = ranges_.back();
            const std::size_t joined =
                std::max(end, last.address + last.words.size()) - last.address;
            if (last.table == reg.table && reg.address <= last.address + last.words.size() &&
                joined <= kMaxReadWords) {
                last.words.resize(joined);
                continue;
            }
        }
        ranges_.push_back({reg.table, reg.address, std::vector<std::uint16_t>(reg.words())});
    }
}

std::span<std::uint16_t> ShakerImage::words_of(const proto::Register& reg) noexcept {
    for (RegisterRange& range : ranges_) {
        if (range.table == reg.table && reg.address >= range.address &&
            reg.address + reg.words() <= range.address + range.words.size()) {
            return std::span(range.words)
                .subspan(static_cast<std::size_t>(reg.address - range.address), reg.words());
        }
    }
    return {};
}

double ShakerImage::value_of(const proto::Register& reg) noexcept {
    return proto::decode(reg, words_of(reg));
}

ShakerReading ShakerImage::reading(Time time) noexcept {
    ShakerReading reading;
    reading.time = time;
    reading.frequency_hz = value_of(registers_.frequency);
    reading.amplitude_g = value_of(registers_.amplitude);
    reading.measured_g = value_of(registers_.measured_amplitude);
    reading.state = to_u16(value_of(registers_.state));
    reading.fault = to_u16(value_of(registers_.fault));
    reading.running = value_of(registers_.run) != 0;
    reading.emergency_stop_open = value_of(registers_.emergency_stop) != 0;
    reading.fresh = true;
    reading.valid = std::isfinite(reading.frequency_hz) && std::isfinite(reading.amplitude_g) &&
                    std::isfinite(reading.measured_g);
    if (registers_.random) reading.random = random_reading(*registers_.random);
    if (registers_.sweep) reading.sweep = sweep_reading(*registers_.sweep);
    return reading;
}

SweepReading ShakerImage::sweep_reading(const proto::SweepRegisters& map) noexcept {
    return {value_of(registers_.mode) == kModeSweep, value_of(map.from), value_of(map.to),
            value_of(map.rate), value_of(map.actual_frequency)};
}

RandomReading ShakerImage::random_reading(const proto::RandomRegisters& map) noexcept {
    RandomReading reading;
    const std::uint16_t control = to_u16(value_of(map.control_state));
    const double checksum = value_of(map.profile_checksum);
    reading.random = value_of(registers_.mode) == kModeRandom;
    reading.profile = to_u16(value_of(map.profile_number));
    reading.level_db = value_of(map.profile_level_db);
    if (checksum >= 0 && checksum <= 0xffffffff)
        reading.checksum = static_cast<std::uint32_t>(checksum);
    reading.measured_g_rms = value_of(map.measured_g_rms);
    // What is not a state it knows is none that it may be in.
    reading.state = static_cast<RandomReading::State>(std::min(control & 0xf, 3));
    reading.bands_armed = (control & kBandsArmed) != 0;
    reading.abort_reason = static_cast<std::uint8_t>(control >> 8);
    return reading;
}

bool same_raw(const proto::Register& reg, std::span<const std::uint16_t> written,
              std::span<const std::uint16_t> read) noexcept {
    const bool bits = reg.type == proto::RegisterType::bits;
    return std::equal(written.begin(), written.end(), read.begin(), read.end(),
                      [&](std::uint16_t a, std::uint16_t b) {
                          return bits ? ((a ^ b) & reg.mask) == 0 : a == b;
                      });
}

void check_registers(const ShakerSettings& settings) {
    const proto::ShakerRegisters& map = settings.registers;
    if (!map.watchdog) {
        throw ShakerError(
            "shaker.registers.watchdog: is missing; expected a register that stops the shaker when "
            "it is no longer "
            "written");
    }
    check_role("frequency", map.frequency, true, true);
    check_role("amplitude", map.amplitude, true, true);
    check_role("ramp_time", map.ramp_time, true, true);
    check_role("run", map.run, true, true);
    check_role("watchdog", *map.watchdog, false, true);
    if (map.watchdog->type == proto::RegisterType::bits) {
        throw ShakerError(
            "shaker.registers.watchdog.type: must be a number that counts up, got bits");
    }
    check_role("watchdog_timeout", map.watchdog_timeout, true, false);
    check_role("state", map.state, true, false);
    check_role("fault", map.fault, true, false);
    check_role("emergency_stop", map.emergency_stop, true, false);
    check_role("measured_amplitude", map.measured_amplitude, true, false);
    if (map.random || map.sweep) check_role("mode", map.mode, true, true);
    if (const auto& sweep = map.sweep) {
        check_role("sweep_from", sweep->from, true, true);
        check_role("sweep_to", sweep->to, true, true);
        check_role("sweep_rate", sweep->rate, true, true);
        check_role("actual_frequency", sweep->actual_frequency, true, false);
    }
    if (const auto& random = map.random) {
        check_role("profile_number", random->profile_number, true, true);
        check_role("profile_level_db", random->profile_level_db, true, true);
        check_role("profile_checksum", random->profile_checksum, true, false);
        check_role("measured_g_rms", random->measured_g_rms, true, false);
        check_role("control_state", random->control_state, true, false);
        if (random->psd_block) check_block(*random->psd_block);
    }
    std::array<std::uint16_t, 2> words{};
    const double timeout_s = 3 * to_seconds(settings.watchdog_period);
    if (map.watchdog_timeout.access != proto::Access::read &&
        !proto::encode(map.watchdog_timeout, timeout_s,
                       std::span(words).first(map.watchdog_timeout.words()))) {
        throw ShakerError(
            "shaker.watchdog_period: three of them must fit shaker.registers.watchdog_timeout, "
            "got " +
            std::to_string(timeout_s) + " s");
    }
}

}  // namespace vibrig::drivers
