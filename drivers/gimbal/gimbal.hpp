#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
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
    /// What cables allow outer, inner and azimuth, readings in deg, lowest and highest; a whole
    /// turn or more: no limit.
    std::array<std::array<double, 2>, 3> travel_deg{{{-360, 360}, {-360, 360}, {-360, 360}}};
};

/// The same angle, whole turns aside, within the travel; nothing: the travel does not reach it.
[[nodiscard]] inline std::optional<double> within_travel(
    double degrees, const std::array<double, 2>& travel_deg) noexcept {
    constexpr double kDust = 1e-6;
    const double middle = 0.5 * (travel_deg[0] + travel_deg[1]);
    const double nearest = middle + std::remainder(degrees - middle, 360.0);
    if (nearest < travel_deg[0] - kDust || nearest > travel_deg[1] + kDust) return std::nullopt;
    return nearest;
}

enum class GimbalState : std::uint8_t {
    idle,        ///< nothing commanded yet, or released
    commanding,  ///< sent, not yet echoed
    slewing,
    in_position,
    timed_out,  ///< not there within slew_timeout; stays until the next command
    no_status,  ///< commanded, but the platform's status is older than status_deadline
};
[[nodiscard]] const char* name_of(GimbalState state) noexcept;

/// Of a platform that was released: whether it is left to drift.
enum class Drift : std::uint8_t {
    free,  ///< or not released by us
    slews,
    led,     ///< by somebody else's command
    silent,  ///< status older than status_deadline
};

/// Sends gimbal commands and follows them to "in position". Control thread only.
class Gimbal {
  public:
    /// Throws BindingError if the DBC lacks the message or one of its signals. The Dbc and the port
    /// must outlive this.
    Gimbal(const proto::Dbc& dbc, const GimbalSettings& settings, CanPort& port);
    /// Starts a slew to outer, inner, azimuth in deg, as the encoders count. `increments`: the
    /// platform sends the increments of its gyros and accelerometers until the next command.
    /// A gimbal may take the shorter way round; where cables limit its travel it goes by the
    /// travel's middle, so that this is the way within it. A target that the travel does not reach
    /// is not sent: the slew times out.
    void slew_to(const std::array<double, 3>& position_deg, Time now,
                 bool increments = false) noexcept;
    /// Somebody may have turned the gimbals: the next slew takes no short cut.
    void forget_position() noexcept { here_deg_.reset(); }
    /// Somebody knows from the readings: the next slew takes the direct way where that is shorter.
    void stands_at(const std::array<double, 3>& position_deg) noexcept { here_deg_ = position_deg; }
    /// Lets the platform drift freely under its gyros: no torquing.
    void release(Time now) noexcept;
    /// Follows the platform's status; sends again what was not echoed. To be called at
    /// next_deadline() and on new status.
    GimbalState update(const PlatformStatus& status, Time now) noexcept;
    [[nodiscard]] Time next_deadline() const noexcept;
    [[nodiscard]] GimbalState state() const noexcept { return state_; }
    /// By the platform's own word.
    [[nodiscard]] Drift drift(const PlatformStatus& status, Time now) const noexcept;

  private:
    enum class Mode : std::uint8_t { free_drift = 0, slew = 1, slew_with_increments = 2 };
    void command(Mode mode, Time now) noexcept;
    void next_leg(Time now) noexcept;
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
    std::array<double, 3> target_deg_{};               ///< of the leg under way
    std::optional<std::array<double, 3>> beyond_deg_;  ///< where it goes on to
    std::optional<std::array<double, 3>> here_deg_;    ///< where the last slew has ended
    Mode mode_ = Mode::free_drift;
    Mode after_ = Mode::slew;  ///< of the last leg
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
