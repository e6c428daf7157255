#pragma once

#include <linux/can.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "proto/dbc.hpp"
#include "tests/plant/faults.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::plant {

/// A message of the DBC with the signals wanted from it, looked up once.
class FrameLayout {
  public:
    /// Throws PlantError naming the message or signal that the DBC lacks.
    FrameLayout(const proto::Dbc& dbc, const char* message,
                std::initializer_list<const char*> signals);
    [[nodiscard]] can_frame encode(std::initializer_list<double> values) const noexcept;
    /// True if the frame is this message; a frame too short gives false too.
    [[nodiscard]] bool decode(const canfd_frame& frame, std::span<double> values) const noexcept;

  private:
    canid_t id_ = 0;
    std::uint8_t size_ = 0;
    std::vector<proto::Signal> signals_;
};

struct TorqueCommand {
    Vec3 deg_per_h{};
    std::uint8_t counter = 0;
};

struct GimbalCommand {
    Vec3 encoder_deg{};
    GimbalMode mode = GimbalMode::free_drift;
    std::uint8_t counter = 0;
};

/// The rig's side of rig.dbc: readings to frames, frames to commands.
class Frames {
  public:
    explicit Frames(const proto::Dbc& dbc);

    [[nodiscard]] can_frame rig_time(std::int64_t time_us, bool tick_end) const noexcept;
    /// Sync first, then the sample; status frames when their cycle time has come.
    void encode(const Rig& rig, const Sample& sample, const Faults& faults,
                std::uint8_t command_echo, std::uint8_t torque_echo,
                std::vector<can_frame>& out) const;

    [[nodiscard]] std::optional<std::int64_t> acknowledged_us(
        const canfd_frame& frame) const noexcept;
    [[nodiscard]] std::optional<GimbalCommand> gimbal_command(
        const canfd_frame& frame) const noexcept;
    [[nodiscard]] std::optional<TorqueCommand> torque_command(
        const canfd_frame& frame) const noexcept;

  private:
    FrameLayout rig_time_, rig_ack_, sync_, resolvers_, azimuth_, accelerometers_xy_,
        accelerometer_z_, table_, gimbal_status_, platform_status_, gimbal_command_,
        torque_command_, gyro_increments_, accelerometer_increments_;
    std::vector<FrameLayout> temperatures_;
};

}  // namespace vibrig::plant
