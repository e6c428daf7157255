#pragma once

#include <string>
#include <utility>
#include <vector>

#include "drivers/sample/assembler.hpp"
#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::test {

/// Samples in each CAN FD frame of the bus below.
inline constexpr std::uint32_t kFdSamples = 4;

/// A bus of CAN FD frames: one message of 64 bytes, whose multiplexor says whether it carries the
/// angles or the specific forces of four samples.
inline std::string fd_dbc_text(int size = 64) {
    std::string text =
        "VERSION \"\"\n\nBU_: Vibrig Platform\n\nBO_ 800 Motion: " + std::to_string(size) +
        " Platform\n"
        " SG_ Count : 0|32@1+ (1,0) [0|4294967295] \"\" Vibrig\n"
        " SG_ Kind M : 32|8@1+ (1,0) [0|1] \"\" Vibrig\n";
    const std::vector<std::pair<const char*, bool>> signals{
        {"Outer", true}, {"Inner", true}, {"Azimuth", true}, {"X", false},
        {"Y", false},    {"Z", false},    {"Axial", false}};
    unsigned angles = 40, forces = 40;
    for (std::uint32_t part = 0; part < kFdSamples; ++part) {
        for (const auto& [name, angle] : signals) {
            unsigned& at = angle ? angles : forces;
            text += " SG_ " + std::string(name) + (part == 0 ? "" : "_" + std::to_string(part)) +
                    (angle ? " m0 : " : " m1 : ") + std::to_string(at) +
                    (angle ? "|20@1+ (0.00034332275390625,0) [0|360] \"deg\""
                           : "|24@1- (0.000003814697265625,0) [-31|31] \"g\"") +
                    " Vibrig\n";
            at += angle ? 20 : 24;
        }
    }
    return text;
}

inline const proto::Dbc& fd_dbc() {
    static const proto::Dbc dbc = proto::parse_dbc(fd_dbc_text(), "fd.dbc");
    return dbc;
}

/// Bindings to it; what a platform tells of itself is not on that bus.
inline drivers::AssemblerSettings fd_settings(drivers::Time sample_period) {
    drivers::AssemblerSettings settings;
    settings.sample_period = sample_period;
    settings.samples_per_frame = kFdSamples;
    auto& b = settings.bindings;
    b = {};
    b.sync_count = "Motion.Count";
    b.outer = "Motion.Outer";
    b.inner = "Motion.Inner";
    b.azimuth = "Motion.Azimuth";
    b.accel_x = "Motion.X";
    b.accel_y = "Motion.Y";
    b.accel_z = "Motion.Z";
    b.table_accel = "Motion.Axial";
    b.outer_valid = b.inner_valid = b.azimuth_valid = b.accel_x_valid = b.accel_y_valid =
        b.accel_z_valid = "";
    b.loop_closed = b.gyros_at_speed = b.ready = b.fault = b.temperature = "";
    b.in_position = b.slewing = b.command_echo = "";
    return settings;
}

/// Of the samples `first` to `first` + 3: angles (0) or forces (1), as truth() has them.
inline drivers::ReceivedFrame fd_frame(std::uint32_t first, int kind, drivers::Time time,
                                       const proto::Dbc& dbc = fd_dbc()) {
    static constexpr std::array<const char*, 7> kNames{"Outer", "Inner", "Azimuth", "X",
                                                       "Y",     "Z",     "Axial"};
    std::vector<std::string> names;
    std::vector<std::pair<std::string_view, double>> values{{"Count", first}, {"Kind", kind}};
    names.reserve(kFdSamples * kNames.size());
    for (std::uint32_t part = 0; part < kFdSamples; ++part) {
        for (std::size_t c = kind == 0 ? 0 : 3; c < (kind == 0 ? 3 : kNames.size()); ++c) {
            names.push_back(kNames[c] + (part == 0 ? "" : "_" + std::to_string(part)));
            values.emplace_back(names.back(), truth(first + part, c));
        }
    }
    auto frame = frame_of(dbc, "Motion", time, values);
    frame.fd = true;
    frame.frame.flags = CANFD_FDF | CANFD_BRS;
    return frame;
}

}  // namespace vibrig::test
