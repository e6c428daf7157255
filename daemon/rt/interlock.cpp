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
    if (!watching_.load(std::memory_order_relaxed)) return;
    if (!platform.loop_closed) trip(Trip::loop_open);
    if (sample.of(Channel::table_accel) == drivers::Quality::good &&
        !(std::abs(sample.table_accel) <= limits_.table_g)) {
        trip(Trip::over_amplitude);
    }
}

void Interlock::check_ages(const drivers::SampleAssembler& assembler, drivers::Time now) noexcept {
    if (!watching_.load(std::memory_order_relaxed)) return;
    for (const auto c : {Channel::outer, Channel::inner, Channel::azimuth, Channel::accel_x,
                         Channel::accel_y, Channel::accel_z}) {
        if (assembler.stale(c, now)) trip(Trip::stale_channel);
    }
}

void Interlock::lost_bus() noexcept {
    if (watching_.load(std::memory_order_relaxed)) trip(Trip::can_lost);
}

void Interlock::check(const drivers::ShakerReading& reading) noexcept {
    if (!watching_.load(std::memory_order_relaxed) || !reading.valid) return;
    if (reading.emergency_stop_open) trip(Trip::emergency_stop);
    if (reading.measured_g > limits_.table_g) trip(Trip::over_amplitude);
}

}  // namespace vibrig::rt
