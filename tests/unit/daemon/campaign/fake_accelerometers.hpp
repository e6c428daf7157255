#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "daemon/interlock/rest_monitor.hpp"

namespace vibrig::campaign {

/// Accelerometers of platform and table at 40 Hz, as the monitor of rest sees them. The table does
/// what the controller says, or what the test says.
struct FakeAccelerometers {
    static constexpr drivers::Time kPeriod = 25 * drivers::kMillisecond;
    rt::RestMonitor monitor{{}, kPeriod};
    drivers::Time fed = 0;
    std::optional<double> table_g;     ///< peak, in truth
    std::optional<double> platform_g;  ///< where it does not follow the table
    bool silent = false;
    bool table_good = true;
    bool table_bound = true;
    std::function<void(const drivers::Sample&)> also;

    void run_to(drivers::Time now, double controller_g) {
        fed = std::max(fed, now - drivers::kSecond);
        for (; fed + kPeriod <= now; fed += kPeriod) {
            if (silent) continue;
            drivers::Sample sample;
            sample.time = fed + kPeriod;
            const double phase = 2 * std::numbers::pi * 15 * drivers::to_seconds(sample.time);
            sample.table_accel = table_g.value_or(controller_g) * std::sin(phase);
            const double platform =
                platform_g ? *platform_g * std::sin(phase) : 2.0 / 3 * sample.table_accel;
            sample.force = {0, 1 + platform, 0};
            sample.quality.fill(drivers::Quality::good);
            if (!table_good)
                sample.quality[static_cast<std::size_t>(drivers::Channel::table_accel)] =
                    drivers::Quality::flagged;
            if (!table_bound)
                sample.quality[static_cast<std::size_t>(drivers::Channel::table_accel)] =
                    drivers::Quality::unbound;
            monitor.add(sample);
            if (also) also(sample);
        }
    }
};

}  // namespace vibrig::campaign
