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
    loop_open,
    over_amplitude,
    emergency_stop,
    can_lost
};
[[nodiscard]] const char* text_of(Trip trip) noexcept;

/// Stops the shaker from the acquisition thread, before anything else sees the sample. Latched
/// until acknowledged.
class Interlock {
  public:
    struct Limits {
        double table_g = 12.0;  ///< largest table acceleration
    };

    Interlock(drivers::Shaker& shaker, drivers::Waiter& control, Limits limits)
        : shaker_(shaker), control_(control), limits_(limits) {}

    /// Watches only while excitation is allowed (control thread).
    void watch(bool excitation) noexcept { watching_.store(excitation); }
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
    void acknowledge() noexcept { tripped_.store(Trip::none); }

  private:
    drivers::Shaker& shaker_;
    drivers::Waiter& control_;
    Limits limits_;
    std::atomic<bool> watching_{false};
    std::atomic<Trip> tripped_{Trip::none};
};

}  // namespace vibrig::rt
