#pragma once

#include <array>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>

#include "drivers/sample/assembler.hpp"
#include "drivers/sample/sample.hpp"

namespace vibrig::drivers {

/// What there is to know of a channel beside its place in a Sample: keys, status and metrics follow
/// from it.
struct ChannelRow {
    Channel channel;
    const char* name;  ///< key can.signals.NAME, and NAME_valid; in status and metrics, too
    const char* unit;  ///< of the bound signal, and of what is shown
    const char* help;
    std::string SignalBindings::*signal;
    std::string SignalBindings::*valid;  ///< null: no signal says whether it is valid
    const char* valid_help;
    double (*value)(const Sample&);  ///< in that unit
};

namespace channels {
using S = SignalBindings;
inline constexpr const char* kAngle = "1: the angle is valid";
inline constexpr const char* kForce = "1: the specific force is valid";
template <std::size_t Axis>
double angle_deg(const Sample& s) {
    return s.angle[Axis] * (180 / std::numbers::pi);
}
template <std::size_t Axis>
double force_g(const Sample& s) {
    return s.force[Axis];
}
inline double table_g(const Sample& s) { return s.table_accel; }
}  // namespace channels

/// By Channel.
// clang-format off
inline constexpr std::array<ChannelRow, kChannels> kChannelTable{{
    {Channel::outer, "outer", "deg", "outer gimbal, deg",
     &channels::S::outer, &channels::S::outer_valid, channels::kAngle, channels::angle_deg<0>},
    {Channel::inner, "inner", "deg", "inner gimbal, deg",
     &channels::S::inner, &channels::S::inner_valid, channels::kAngle, channels::angle_deg<1>},
    {Channel::azimuth, "azimuth", "deg", "azimuth gimbal, deg",
     &channels::S::azimuth, &channels::S::azimuth_valid, channels::kAngle, channels::angle_deg<2>},
    {Channel::accel_x, "accel_x", "g", "specific force, g",
     &channels::S::accel_x, &channels::S::accel_x_valid, channels::kForce, channels::force_g<0>},
    {Channel::accel_y, "accel_y", "g", "specific force, g",
     &channels::S::accel_y, &channels::S::accel_y_valid, channels::kForce, channels::force_g<1>},
    {Channel::accel_z, "accel_z", "g", "specific force, g",
     &channels::S::accel_z, &channels::S::accel_z_valid, channels::kForce, channels::force_g<2>},
    {Channel::table_accel, "table_accel", "g", "table accelerometer, g",
     &channels::S::table_accel, nullptr, "", channels::table_g},
}};
// clang-format on
static_assert([] {
    for (std::size_t i = 0; i < kChannels; ++i)
        if (static_cast<std::size_t>(kChannelTable[i].channel) != i) return false;
    return true;
}());

/// What the platform and the gimbals report of themselves: key can.signals.NAME.
struct StatusRow {
    const char* name;
    std::string SignalBindings::*signal;
    const char* help;
    bool PlatformStatus::*flag = nullptr;  ///< that is set unless the value is 0
    bool of_gimbals = false;
    std::optional<std::size_t> sensor = {};  ///< place in kTemperatureSensors
    const char* unit = "";
};

inline constexpr std::array kStatusTable{
    StatusRow{"loop_closed", &SignalBindings::loop_closed, "1: stabilisation loop closed",
              &PlatformStatus::loop_closed},
    StatusRow{"gyros_at_speed", &SignalBindings::gyros_at_speed, "1: gyro wheels at speed",
              &PlatformStatus::gyros_at_speed},
    StatusRow{"ready", &SignalBindings::ready, "1: platform ready", &PlatformStatus::ready},
    StatusRow{"fault", &SignalBindings::fault, "1: platform fault", &PlatformStatus::fault},
    StatusRow{"temperature",
              &SignalBindings::temperature,
              "platform temperature, degC",
              nullptr,
              false,
              {},
              "degC"},
    StatusRow{"in_position", &SignalBindings::in_position, "1: gimbals in position",
              &PlatformStatus::in_position, true},
    StatusRow{"slewing", &SignalBindings::slewing, "1: gimbals slewing", &PlatformStatus::slewing,
              true},
    StatusRow{"command_echo", &SignalBindings::command_echo,
              "counter of the last gimbal command accepted", nullptr, true},
    StatusRow{"temperature_case", &SignalBindings::temperature_case,
              "degC; the default may be missing in the DBC", nullptr, false, 0, "degC"},
    StatusRow{"temperature_gyro_x", &SignalBindings::temperature_gyro_x,
              "degC; as temperature_case", nullptr, false, 1, "degC"},
    StatusRow{"temperature_gyro_y", &SignalBindings::temperature_gyro_y,
              "degC; as temperature_case", nullptr, false, 2, "degC"},
    StatusRow{"temperature_gyro_z", &SignalBindings::temperature_gyro_z,
              "degC; as temperature_case", nullptr, false, 3, "degC"}};

}  // namespace vibrig::drivers
