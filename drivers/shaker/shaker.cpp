#include "drivers/shaker/shaker.hpp"

#include <array>

#include "drivers/shaker/modbus_shaker.hpp"
#include "drivers/shaker/shaker_image.hpp"
#include "proto/word_of.hpp"

namespace vibrig::drivers {
namespace {

void check_period(const char* key, Time value, Time least) {
    if (value >= least && value <= 3600 * kSecond) return;
    throw ShakerError(std::string("shaker.") + key + ": must be from " +
                      std::to_string(to_seconds(least)) + " to 3600 s, got " +
                      std::to_string(to_seconds(value)) + " s");
}

void check_range(const char* key, int value, int least, int most) {
    if (value >= least && value <= most) return;
    throw ShakerError(std::string("shaker.") + key + ": must be from " + std::to_string(least) +
                      " to " + std::to_string(most) + ", got " + std::to_string(value));
}

}  // namespace

const char* name_of(LinkState state) noexcept {
    static constexpr std::array kWords{"absent", "connecting", "running", "degraded", "fault"};
    return proto::word_of(kWords, state);
}

std::unique_ptr<Shaker> make_shaker(Clock& clock, const ShakerSettings& settings) {
    check_registers(settings);
    check_period("response_timeout", settings.response_timeout, kMillisecond);
    check_period("poll_period", settings.poll_period, kMillisecond);
    check_period("watchdog_period", settings.watchdog_period, kMillisecond);
    check_period("backoff_min", settings.backoff_min, kMillisecond);
    check_period("backoff_max", settings.backoff_max, settings.backoff_min);
    if (settings.transport == ShakerSettings::Transport::tcp) {
        check_range("port", settings.port, 1, 65535);
        check_range("unit", settings.unit, 0, 255);
        if (settings.host.empty())
            throw ShakerError("shaker.host: must be an address or name, got none");
    } else {
        check_range("unit", settings.unit, 1, 247);  // 0 is the broadcast, which nobody answers
        check_range("baud", settings.baud, 1200, 921600);
        if (settings.device.empty())
            throw ShakerError("shaker.device: must be a serial device, got none");
    }
    return std::make_unique<ModbusShaker>(clock, settings);
}

}  // namespace vibrig::drivers
