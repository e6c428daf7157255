#pragma once

#include <atomic>
#include <cstdint>

#include "drivers/assembler.hpp"
#include "drivers/sample.hpp"
#include "drivers/shaker.hpp"

namespace vibrig::rt {

enum class Trip : std::uint8_t {
    none,
    stale_channel,
    stale_platform,
    loop_open,
    platform_fault,
    over_amplitude,
    emergency_stop,
    shaker_fault,
    uncommanded,
    can_lost
};
[[nodiscard]] const char* text_of(Trip trip) noexcept;

/// How much is watched. Each level includes the one before.
enum class Guard : std::uint8_t {
    idle,       ///< disarmed: only that the shaker rests
    armed,      ///< armed or in a campaign: also emergency stop, faults, the bus
    excitation  ///< from the ramp to rest: also amplitude, channels, platform
};

/// Stops the shaker from the acquisition thread, before anything else sees the sample. Latched
/// until acknowledged.
class Interlock {
  public:
    struct Limits {
        double table_g = 12.0;                                     ///< largest table acceleration
        drivers::Time platform_age = 500 * drivers::kMillisecond;  ///< of the platform's status
    };

    Interlock(drivers::Shaker& shaker, drivers::Waiter& control, Limits limits)
        : shaker_(shaker), control_(control), limits_(limits) {}

    void guard(Guard level) noexcept { guard_.store(level); }  ///< control thread
    /// Acquisition thread, before the sample goes anywhere.
    void check(const drivers::Sample& sample, const drivers::PlatformStatus& platform) noexcept;
    /// Acquisition thread, on its timer: silence trips too.
    void check_ages(const drivers::SampleAssembler& assembler, drivers::Time now) noexcept;
    /// Shaker thread, after each read-back.
    void check(const drivers::ShakerReading& reading) noexcept;
    /// Acquisition thread: the CAN port is no longer running.
    void lost_bus() noexcept;
    /// Any thread. The first cause stays.
    void trip(Trip cause) noexcept;

    [[nodiscard]] Trip tripped() const noexcept { return tripped_.load(); }
    /// Clears the trip if it is `handled`; one that came meanwhile stays.
    void acknowledge(Trip handled) noexcept {
        tripped_.compare_exchange_strong(handled, Trip::none);
    }

  private:
    [[nodiscard]] bool at_least(Guard level) const noexcept { return guard_.load() >= level; }

    drivers::Shaker& shaker_;
    drivers::Waiter& control_;
    Limits limits_;
    std::atomic<Guard> guard_{Guard::idle};
    std::atomic<Trip> tripped_{Trip::none};
};

}  // namespace vibrig::rt
