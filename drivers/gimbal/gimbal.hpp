#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "drivers/can/can_port.hpp"
#include "drivers/sample/sample.hpp"
#include "proto/dbc.hpp"

namespace vibrig::drivers {

struct GimbalSettings {
    std::string message = "GimbalCommand";  ///< signals Outer, Inner, Azimuth (deg), Mode, Counter
    Time status_deadline = 500 * kMillisecond;  ///< status older than this is not believed
    Time slew_timeout = 120 * kSecond;
    Time repeat = 200 * kMillisecond;  ///< command sent again until its counter is echoed
};

enum class GimbalState : std::uint8_t {
    idle,        ///< nothing commanded yet, or released
    commanding,  ///< sent, not yet echoed
    slewing,
    in_position,
    timed_out,  ///< not there within slew_timeout; stays until the next command
    no_status,  ///< commanded, but the platform's status is older than status_deadline
};
[[nodiscard]] const char* name_of(GimbalState state) noexcept;

/// Sends gimbal commands and follows them to "in position". Control thread only.
class Gimbal {
  public:
    /// Throws BindingError if the DBC lacks the message or one of its signals. The Dbc and the port
    /// must outlive this.
    Gimbal(const proto::Dbc& dbc, const GimbalSettings& settings, CanPort& port);
    /// Starts a slew to outer, inner, azimuth in deg, as the encoders count. `increments`: the
    /// platform sends the increments of its gyros and accelerometers until the next command.
    void slew_to(const std::array<double, 3>& position_deg, Time now,
                 bool increments = false) noexcept;
    /// Lets the platform drift freely under its gyros: no torquing.
    void release(Time now) noexcept;
    /// Follows the platform's status; sends again what was not echoed. To be called at
    /// next_deadline() and on new status.
    GimbalState update(const PlatformStatus& status, Time now) noexcept;
    [[nodiscard]] Time next_deadline() const noexcept;
    [[nodiscard]] GimbalState state() const noexcept { return state_; }

  private:
    enum class Mode : std::uint8_t { free_drift = 0, slew = 1, slew_with_increments = 2 };
    void command(Mode mode, Time now) noexcept;
    void send(Time now) noexcept;
    [[nodiscard]] GimbalState follow(const PlatformStatus& status, Time now) noexcept;
    /// The angle as this signal can carry it: 350 deg goes out as -10 deg where the range is +-180
    /// deg or so.
    [[nodiscard]] static double representable(const proto::Signal& signal, double degrees) noexcept;

    const proto::Message* message_;
    std::array<const proto::Signal*, 3> angles_{};
    const proto::Signal* mode_signal_ = nullptr;
    const proto::Signal* counter_signal_ = nullptr;
    GimbalSettings settings_;
    CanPort& port_;
    std::array<double, 3> target_deg_{};
    Mode mode_ = Mode::free_drift;
    std::uint8_t counter_ = 0;
    bool commanded_ = false;
    bool echoed_ = true;
    bool arrived_ = false;  ///< was in position since the command: no timeout any more
    Time commanded_at_ = 0;
    Time sent_at_ = 0;
    Time status_at_ = 0;
    GimbalState state_ = GimbalState::idle;
};

}  // namespace vibrig::drivers
