#include "tests/plant/frames.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace vibrig::plant {

FrameLayout::FrameLayout(const proto::Dbc& dbc, const char* message,
                         std::initializer_list<const char*> signals) {
    const proto::Message* found = dbc.find(std::string_view(message));
    if (found == nullptr) throw PlantError(std::string("DBC: no message ") + message);
    if (found->size > CAN_MAX_DLEN) {
        throw PlantError(std::string("DBC: ") + message + ": " + std::to_string(found->size) +
                         " bytes, expected a classic frame of at most 8");
    }
    id_ = found->id | (found->extended ? CAN_EFF_FLAG : 0U);
    size_ = found->size;
    for (const char* name : signals) {
        const proto::Signal* signal = found->find(name);
        if (signal == nullptr)
            throw PlantError(std::string("DBC: ") + message + ": no signal " + name);
        signals_.push_back(*signal);
    }
}

can_frame FrameLayout::encode(std::initializer_list<double> values) const noexcept {
    can_frame frame{};
    frame.can_id = id_;
    frame.len = size_;
    std::size_t i = 0;
    for (const double value : values) {
        // Cannot fail: the size is the message's own and the rig's values are finite.
        static_cast<void>(proto::encode(signals_[i++], value, std::span(frame.data, size_)));
    }
    return frame;
}

bool FrameLayout::decode(const canfd_frame& frame, std::span<double> values) const noexcept {
    if (frame.can_id != id_) return false;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto value =
            proto::decode(signals_[i], std::span(frame.data, std::min<std::size_t>(frame.len, 64)));
        if (!value) return false;
        values[i] = *value;
    }
    return true;
}

Frames::Frames(const proto::Dbc& dbc)
    : rig_time_(dbc, "RigTime", {"TimeUs", "TickEnd"}),
      rig_ack_(dbc, "RigAck", {"TimeUs"}),
      sync_(dbc, "Sync", {"SyncCount"}),
      resolvers_(dbc, "Resolvers", {"Outer", "Inner", "OuterValid", "InnerValid", "SyncLow"}),
      azimuth_(dbc, "ResolverAzimuth", {"Azimuth", "AzimuthValid", "SyncLow"}),
      accelerometers_xy_(dbc, "AccelerometersXY", {"X", "Y", "XValid", "YValid", "SyncLow"}),
      accelerometer_z_(dbc, "AccelerometerZ", {"Z", "ZValid", "SyncLow"}),
      table_(dbc, "TableAccelerometer", {"Axial", "SyncLow"}),
      gimbal_status_(dbc, "GimbalStatus",
                     {"InPosition", "Slewing", "Mode", "CommandEcho", "Torquing", "TorqueEcho"}),
      platform_status_(dbc, "PlatformStatus",
                       {"Ready", "LoopClosed", "GyrosAtSpeed", "Fault", "Temperature"}),
      gimbal_command_(dbc, "GimbalCommand", {"Outer", "Inner", "Azimuth", "Mode", "Counter"}),
      torque_command_(dbc, "TorqueCommand", {"X", "Y", "Z", "Counter"}),
      gyro_increments_(dbc, "GyroIncrements", {"X", "Y", "Z", "Counter"}),
      accelerometer_increments_(dbc, "AccelerometerIncrements", {"X", "Y", "Z", "Counter"}) {
    for (const char* sensor : {"Case", "GyroX", "GyroY", "GyroZ"}) {
        temperatures_.emplace_back(dbc, "PlatformTemperatures",
                                   std::initializer_list<const char*>{"Sensor", sensor});
    }
}

can_frame Frames::rig_time(std::int64_t time_us, bool tick_end) const noexcept {
    return rig_time_.encode({static_cast<double>(time_us), tick_end ? 1.0 : 0.0});
}

void Frames::encode(const Rig& rig, const Sample& sample, const Faults& faults,
                    std::uint8_t command_echo, std::uint8_t torque_echo,
                    std::vector<can_frame>& out) const {
    const std::int64_t tick = rig.tick();
    const double time_s = 1e-6 * static_cast<double>(rig.time_us());
    const auto count = static_cast<double>(static_cast<std::uint32_t>(tick));
    const auto low = static_cast<double>(static_cast<std::uint8_t>(tick));
    const Vec3& angle = sample.readings.encoder_deg;
    const Vec3& force = sample.readings.raw_g;
    const auto bit = [](bool on) { return on ? 1.0 : 0.0; };
    const auto valid = [&](std::size_t channel) { return bit(sample.valid[channel]); };

    out.push_back(sync_.encode({count}));
    out.push_back(resolvers_.encode({angle[0], angle[1], valid(0), valid(1), low}));
    out.push_back(azimuth_.encode({angle[2], valid(2), low}));
    out.push_back(accelerometers_xy_.encode({force[0], force[1], valid(3), valid(4), low}));
    out.push_back(accelerometer_z_.encode({force[2], valid(5), low}));
    out.push_back(table_.encode({sample.readings.table_g, low}));
    for (const Increment& i : rig.increments()) {
        const auto counter = static_cast<double>(static_cast<std::uint8_t>(i.count));
        const Vec3& a = i.turn_arcsec;
        const Vec3& v = i.velocity_mps;
        out.push_back(gyro_increments_.encode({a[0], a[1], a[2], counter}));
        out.push_back(accelerometer_increments_.encode({v[0], v[1], v[2], counter}));
    }
    const double temperature = sample.readings.temperature_c;
    if (tick % 4 == 0) {  // 10 Hz
        const Gimbals& gimbals = rig.gimbals();
        out.push_back(gimbal_status_.encode(
            {bit(gimbals.in_position()), bit(gimbals.slewing()),
             static_cast<double>(gimbals.mode()), static_cast<double>(command_echo),
             bit(rig.torque() != Vec3{}), static_cast<double>(torque_echo)}));
        out.push_back(platform_status_.encode(
            {bit(rig.ready()),
             bit(rig.gyros_at_speed() && faults.active(FaultKind::loop_open, time_s) == nullptr),
             bit(rig.gyros_at_speed()),
             bit(faults.active(FaultKind::platform_fault, time_s) != nullptr), temperature}));
    }
    if (tick % 10 == 2) {  // each sensor once a second
        const auto sensor = static_cast<std::size_t>(tick / 10 % 4);
        out.push_back(temperatures_[sensor].encode({static_cast<double>(sensor), temperature}));
    }
}

std::optional<std::int64_t> Frames::acknowledged_us(const canfd_frame& frame) const noexcept {
    std::array<double, 1> value{};
    if (!rig_ack_.decode(frame, value)) return std::nullopt;
    return std::llround(value[0]);
}

std::optional<GimbalCommand> Frames::gimbal_command(const canfd_frame& frame) const noexcept {
    std::array<double, 5> value{};
    if (!gimbal_command_.decode(frame, value) ||
        (value[3] != 0 && value[3] != 1 && value[3] != 2)) {
        return std::nullopt;
    }
    return GimbalCommand{{value[0], value[1], value[2]},
                         static_cast<GimbalMode>(static_cast<std::uint8_t>(value[3])),
                         static_cast<std::uint8_t>(value[4])};
}

std::optional<TorqueCommand> Frames::torque_command(const canfd_frame& frame) const noexcept {
    std::array<double, 4> value{};
    if (!torque_command_.decode(frame, value)) return std::nullopt;
    return TorqueCommand{{value[0], value[1], value[2]}, static_cast<std::uint8_t>(value[3])};
}

}  // namespace vibrig::plant
