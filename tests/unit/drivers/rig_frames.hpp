#pragma once

#include <linux/can.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/can/can_port.hpp"
#include "drivers/sample/assembler.hpp"
#include "proto/dbc.hpp"

namespace vibrig::test {

inline const proto::Dbc& rig_dbc() {
    static const proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    return dbc;
}

inline drivers::ReceivedFrame frame_of(
    const proto::Dbc& dbc, std::string_view message_name, drivers::Time time,
    const std::vector<std::pair<std::string_view, double>>& values) {
    const proto::Message& message = *dbc.find(message_name);
    drivers::ReceivedFrame frame;
    frame.time = time;
    frame.frame.can_id = message.id | (message.extended ? CAN_EFF_FLAG : 0);
    frame.frame.len = message.size;
    for (const auto& [name, value] : values) {
        if (!proto::encode(*message.find(name), value,
                           std::span<std::uint8_t>(frame.frame.data, frame.frame.len))) {
            frame.frame.len = 0;  // shows as wrong_length in whatever test made a mistake here
        }
    }
    return frame;
}

/// What channel `channel` of count `count` measures: deg for the angles, g for the others.
/// Different for every count and channel.
inline double truth(std::uint32_t count, std::size_t channel) {
    const double x = static_cast<double>(count % 1000) * 0.3 + static_cast<double>(channel) * 17.0;
    return channel < 3 ? std::fmod(x, 360.0) : x * 0.05 - 10.0;
}

/// All six frames of one sync count, the Sync first.
inline std::vector<drivers::ReceivedFrame> frames_of_count(std::uint32_t count,
                                                           drivers::Time time) {
    const proto::Dbc& dbc = rig_dbc();
    const double low = count % 256;
    return {
        frame_of(dbc, "Sync", time, {{"SyncCount", count}}),
        frame_of(dbc, "Resolvers", time,
                 {{"Outer", truth(count, 0)},
                  {"Inner", truth(count, 1)},
                  {"OuterValid", 1},
                  {"InnerValid", 1},
                  {"SyncLow", low}}),
        frame_of(dbc, "ResolverAzimuth", time,
                 {{"Azimuth", truth(count, 2)}, {"AzimuthValid", 1}, {"SyncLow", low}}),
        frame_of(dbc, "AccelerometersXY", time,
                 {{"X", truth(count, 3)},
                  {"Y", truth(count, 4)},
                  {"XValid", 1},
                  {"YValid", 1},
                  {"SyncLow", low}}),
        frame_of(dbc, "AccelerometerZ", time,
                 {{"Z", truth(count, 5)}, {"ZValid", 1}, {"SyncLow", low}}),
        frame_of(dbc, "TableAccelerometer", time, {{"Axial", truth(count, 6)}, {"SyncLow", low}}),
    };
}

inline constexpr drivers::Time kPeriod = 25 * drivers::kMillisecond;

/// Of samples that come so.
inline drivers::AssemblerSettings rig_settings() {
    drivers::AssemblerSettings settings;
    settings.sample_period = kPeriod;
    return settings;
}
/// Half a unit of the encoders (2^-20 turn) and accelerometers (2^-18 g), plus rounding of doubles.
inline constexpr double kHalfUnitRad = 3.141592653589793 / (1 << 20) * 1.001;
inline constexpr double kHalfUnitG = 0.5 / (1 << 18) * 1.001;

}  // namespace vibrig::test
