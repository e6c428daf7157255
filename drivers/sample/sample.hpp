#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "drivers/base/clock.hpp"

namespace vibrig::drivers {

/// Measured channels of one Sample, in the order of Sample::quality.
enum class Channel : std::uint8_t { outer, inner, azimuth, accel_x, accel_y, accel_z, table_accel };
inline constexpr std::size_t kChannels = 7;
[[nodiscard]] const char* name_of(Channel channel) noexcept;

/// Quality of one channel of one sample. Anything but good is never used as good.
enum class Quality : std::uint8_t {
    good,
    missing,       ///< the frame with this sync count never came
    stale,         ///< no value for longer than the channel's deadline
    flagged,       ///< the device reported invalid
    out_of_range,  ///< outside the DBC's range, or not finite
    unbound,       ///< no signal is bound to this channel
};
[[nodiscard]] const char* name_of(Quality quality) noexcept;

/// One instant of the rig, joined from all frames that carry one sync count. Raw: encoder angles as
/// they come (sign and zero not applied), specific force as it comes (zero and matrix not applied).
struct alignas(64) Sample {
    Time time = 0;                     ///< device time fitted to kernel stamps, ns, whole us
    std::uint32_t sequence = 0;        ///< sync count, extended; wraps at 2^32
    std::uint32_t dropped_before = 0;  ///< records lost in the ring since the previous record
    std::uint64_t published_to = 0;    ///< the ring's own
    std::array<double, 3> angle{};     ///< outer, inner, azimuth, rad, [0, 2 pi)
    std::array<double, 3> force{};     ///< specific force, accelerometer axes, g
    double table_accel = 0;            ///< table accelerometer along its axis, g
    std::array<Quality, 8> quality{};  ///< by Channel; the eighth is padding
    std::array<std::uint8_t, 32> spare{};

    [[nodiscard]] Quality of(Channel c) const { return quality[static_cast<std::size_t>(c)]; }
    [[nodiscard]] bool angles_good() const {
        return quality[0] == Quality::good && quality[1] == Quality::good &&
               quality[2] == Quality::good;
    }
    [[nodiscard]] bool force_good() const {
        return quality[3] == Quality::good && quality[4] == Quality::good &&
               quality[5] == Quality::good;
    }
};
static_assert(std::is_trivially_copyable_v<Sample>);
static_assert(sizeof(Sample) == 128, "two cache lines per sample");

/// Which DBC signal carries what, as "Message.Signal"; empty: not bound. The defaults are those of
/// proto/rig.dbc.
struct SignalBindings {
    /// Full counter; wraps at the signal's width. Without one, frames within half a period form a
    /// sample.
    std::string sync_count = "Sync.SyncCount";
    std::string outer = "Resolvers.Outer", inner = "Resolvers.Inner",
                azimuth = "ResolverAzimuth.Azimuth";  ///< deg
    std::string outer_valid = "Resolvers.OuterValid", inner_valid = "Resolvers.InnerValid",
                azimuth_valid = "ResolverAzimuth.AzimuthValid";
    std::string accel_x = "AccelerometersXY.X", accel_y = "AccelerometersXY.Y",
                accel_z = "AccelerometerZ.Z";  ///< g
    std::string accel_x_valid = "AccelerometersXY.XValid",
                accel_y_valid = "AccelerometersXY.YValid", accel_z_valid = "AccelerometerZ.ZValid";
    std::string table_accel = "TableAccelerometer.Axial";  ///< g
    /// In any message with a channel: the low bits of the sync count it belongs to.
    std::string message_sync_signal = "SyncLow";
    std::string loop_closed = "PlatformStatus.LoopClosed",
                gyros_at_speed = "PlatformStatus.GyrosAtSpeed", ready = "PlatformStatus.Ready",
                fault = "PlatformStatus.Fault", temperature = "PlatformStatus.Temperature";
    std::string in_position = "GimbalStatus.InPosition", slewing = "GimbalStatus.Slewing",
                command_echo = "GimbalStatus.CommandEcho";
    /// degC. Left as they are they may be missing in the DBC: they are recorded, nothing depends
    /// on them.
    std::string temperature_case = "PlatformTemperatures.Case",
                temperature_gyro_x = "PlatformTemperatures.GyroX",
                temperature_gyro_y = "PlatformTemperatures.GyroY",
                temperature_gyro_z = "PlatformTemperatures.GyroZ";
};

/// Temperatures beside the inner element's, in the order of PlatformStatus::sensor_c.
inline constexpr std::array<const char*, 4> kTemperatureSensors{"case", "gyro x", "gyro y",
                                                                "gyro z"};
/// `period`. Throws std::invalid_argument that says whose it is where it is not above 0 ns.
[[nodiscard]] Time checked_period(const char* of, Time period);

/// What the platform reports of itself; slower than samples. Latest value wins.
struct PlatformStatus {
    /// As old as what is older of loop_closed and fault, whatever else comes; 0: not both have come
    /// yet. Where neither is bound: of the newest of the others.
    Time time = 0;
    /// The platform's own ready flag. False, as gyros_at_speed, also where it came each second and
    /// has ceased.
    bool ready = false;
    bool loop_closed = false;  ///< stabilisation loop closed
    bool gyros_at_speed = false;
    double temperature_c = 0;  ///< platform temperature, deg C
    bool fault = false;
    /// At any time since the sample before, whatever was said after it.
    bool loop_was_open = false, had_fault = false;
    Time temperature_time = 0;  ///< of the newest temperature_c; 0: none yet
    /// A thermometer that has said nothing for so long says nothing.
    static constexpr Time kTemperatureDeadline = 60 * kSecond;
    [[nodiscard]] bool knows_temperature(Time now) const noexcept {
        return temperature_time > 0 && now - temperature_time <= kTemperatureDeadline;
    }
    /// As old as what is oldest of in_position, slewing and the echo, of those that are bound; 0:
    /// one of them has not come yet.
    Time gimbal_time = 0;
    bool in_position = false;
    bool slewing = false;
    std::uint8_t gimbal_command_echo = 0;  ///< counter of the last gimbal command accepted
    /// deg C; each with the time of its newest frame, 0: none yet.
    std::array<double, kTemperatureSensors.size()> sensor_c{};
    std::array<Time, kTemperatureSensors.size()> sensor_time{};
};
static_assert(std::is_trivially_copyable_v<PlatformStatus>);

}  // namespace vibrig::drivers
