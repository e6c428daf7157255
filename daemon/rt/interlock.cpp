#include "daemon/rt/interlock.hpp"

#include <cmath>

namespace vibrig::rt {

using drivers::Channel;

const char* text_of(Trip trip) noexcept {
    switch (trip) {
        case Trip::none:
            return "none";
        case Trip::stale_channel:
            return "a resolver or accelerometer channel is stale";
        case Trip::loop_open:
            return "stabilisation loop open";
        case Trip::stale_platform:
            return "the platform's status is stale";
        case Trip::platform_fault:
            return "platform fault";
        case Trip::shaker_fault:
            return "shaker fault";
        case Trip::uncommanded:
            return "the shaker runs without being commanded";
        case Trip::over_amplitude:
            return "table acceleration above the shaker's limit";
        case Trip::emergency_stop:
            return "emergency-stop chain open";
        case Trip::can_lost:
            return "CAN bus lost";
    }
    return "unknown";
}

void Interlock::trip(Trip cause) noexcept {
    Trip expected = Trip::none;
    if (!tripped_.compare_exchange_strong(expected, cause)) return;
    shaker_.stop_now();
    control_.notify();
}

void Interlock::check(const drivers::Sample& sample,
                      const drivers::PlatformStatus& platform) noexcept {
    if (!at_least(Guard::excitation)) return;
    if (!platform.loop_closed) trip(Trip::loop_open);
    if (platform.fault) trip(Trip::platform_fault);
    if (sample.of(Channel::table_accel) == drivers::Quality::good &&
        !(std::abs(sample.table_accel) <= limits_.table_g)) {
        trip(Trip::over_amplitude);
    }
}

void Interlock::check_ages(const drivers::SampleAssembler& assembler, drivers::Time now) noexcept {
    if (!at_least(Guard::excitation)) return;
    for (const auto c : {Channel::outer, Channel::inner, Channel::azimuth, Channel::accel_x,
                         Channel::accel_y, Channel::accel_z}) {
        if (assembler.stale(c, now)) trip(Trip::stale_channel);
    }
    if (now - assembler.platform().time > limits_.platform_age) trip(Trip::stale_platform);
}

void Interlock::lost_bus() noexcept {
    if (at_least(Guard::armed)) trip(Trip::can_lost);
}

void Interlock::check(const drivers::ShakerReading& reading) noexcept {
    if (!reading.valid) return;
    if (reading.running && !at_least(Guard::excitation) && !shaker_.stop_pending()) {
        trip(Trip::uncommanded);
    }
    if (!at_least(Guard::armed)) return;
    if (reading.emergency_stop_open) trip(Trip::emergency_stop);
    if (reading.fault != 0 || reading.state == drivers::kShakerFault) trip(Trip::shaker_fault);
    if (reading.measured_g > limits_.table_g) trip(Trip::over_amplitude);
}

}  // namespace vibrig::rt
