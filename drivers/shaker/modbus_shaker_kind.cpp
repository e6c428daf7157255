// Which kind of vibration the controller plays: chosen at rest only.
#include <array>
#include <cmath>
#include <span>
#include <string>

#include "drivers/shaker/modbus_shaker.hpp"

namespace vibrig::drivers {
namespace {

// A register resolves 1 mHz.
constexpr double kSameFrequency_hz = 0.01;
constexpr double kSameLevel_db = 0.05;

}  // namespace

bool ModbusShaker::same_kind(const ShakerSetPoint& set_point,
                             const ShakerReading& now) const noexcept {
    if (set_point.random || (now.random && now.random->random))
        return set_point.random && now.random && now.random->random &&
               now.random->profile == set_point.random->profile &&
               std::abs(now.random->level_db - set_point.random->level_db) < kSameLevel_db;
    if (set_point.sweep || (now.sweep && now.sweep->on))
        return set_point.sweep && now.sweep && now.sweep->is(*set_point.sweep);
    return std::abs(set_point.frequency_hz - now.frequency_hz) <= kSameFrequency_hz;
}

bool ModbusShaker::choose(const ShakerSetPoint& set_point) {
    const proto::ShakerRegisters& map = settings_.registers;
    const proto::Register& amplitude = map.amplitude;
    if (!set_point.random && !set_point.sweep && image_.value_of(map.mode) == kModeSine)
        return true;
    // As the frequency: at zero amplitude, where the register may still hold the last one.
    if (image_.value_of(amplitude) != 0 && !write_each(std::array{Step{"amplitude", amplitude, 0}}))
        return false;
    if (set_point.random) return choose_random(*set_point.random);
    if (!set_point.sweep) return write_each(std::array{Step{"mode", map.mode, kModeSine}});
    // Likewise without ends between which it may go.
    const SweepSetPoint& sweep = *set_point.sweep;
    return write_each(std::array{Step{"sweep from", map.sweep->from, sweep.from_hz},
                                 Step{"sweep to", map.sweep->to, sweep.to_hz},
                                 Step{"sweep rate", map.sweep->rate, sweep.octaves_per_minute},
                                 Step{"mode", map.mode, kModeSweep}});
}

bool ModbusShaker::choose_random(const RandomSetPoint& random) {
    const proto::RandomRegisters& map = *settings_.registers.random;
    // A controller refuses the mode without a profile that it knows.
    const double number = random.profile;
    if (!write_each(std::array{Step{"profile number", map.profile_number, number},
                               Step{"profile level", map.profile_level_db, random.level_db},
                               Step{"mode", settings_.registers.mode, kModeRandom}}))
        return false;
    Words words{};
    const auto raw = std::span(words).first(map.profile_checksum.words());
    const Reply reply = read(map.profile_checksum, raw);
    if (reply.ok() && proto::decode(map.profile_checksum, raw) == random.checksum) return true;
    if (!reply.ok() && reply.kind != ReplyKind::exception) return false;
    write_failed_ = true;
    if (reply.ok()) ++counts_.read_back_mismatches;
    settle(reply.ok() ? "profile checksum reads back as " +
                            std::to_string(static_cast<std::uint32_t>(
                                proto::decode(map.profile_checksum, raw))) +
                            ", expected " + std::to_string(random.checksum) + " of profile " +
                            std::to_string(random.profile)
                      : "profile checksum cannot be read back: " + reply.text());
    return false;
}

std::string ModbusShaker::changed_by_others(const ShakerReading& reading) {
    // A device that has stopped by itself and reports it has a trip of its own.
    if (!commanded_ || stop_pending() || reading.fault != 0 || reading.state == kShakerFault ||
        reading.emergency_stop_open)
        return {};
    const proto::ShakerRegisters& map = settings_.registers;
    std::string found;
    if (map.random || map.sweep)
        found = differs("mode", map.mode,
                        commanded_->random  ? kModeRandom
                        : commanded_->sweep ? kModeSweep
                                            : kModeSine);
    if (const auto& random = commanded_->random) {
        if (found.empty())
            found = differs("profile number", map.random->profile_number, random->profile);
        if (found.empty())
            found = differs("profile level", map.random->profile_level_db, random->level_db);
        if (found.empty())
            found = differs("profile checksum", map.random->profile_checksum, random->checksum);
    } else if (const auto& sweep = commanded_->sweep) {
        if (found.empty()) found = differs("sweep from", map.sweep->from, sweep->from_hz);
        if (found.empty()) found = differs("sweep to", map.sweep->to, sweep->to_hz);
        if (found.empty())
            found = differs("sweep rate", map.sweep->rate, sweep->octaves_per_minute);
    } else if (found.empty()) {
        found = differs("frequency", map.frequency, commanded_->frequency_hz);
    }
    if (found.empty()) found = differs("amplitude", map.amplitude, commanded_->amplitude_g);
    if (found.empty()) found = differs("ramp time", map.ramp_time, commanded_->ramp_s);
    if (found.empty()) found = differs("run", map.run, 1);
    return found;
}

}  // namespace vibrig::drivers
