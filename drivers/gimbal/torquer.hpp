#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "drivers/can/can_port.hpp"
#include "proto/dbc.hpp"

namespace vibrig::drivers {

struct TorquerSettings {
    std::string message = "TorqueCommand";  ///< signals X, Y, Z (deg/h), Counter
    std::array<int, 3> sign{1, 1, 1};       ///< of the platform's rate over the commanded one
};

/// Sends rates to the platform's torquers, platform axes. Control thread only.
class Torquer {
  public:
    /// Throws BindingError if the DBC lacks the message or one of its signals. The Dbc and the port
    /// must outlive this.
    Torquer(const proto::Dbc& dbc, const TorquerSettings& settings, CanPort& port);

    /// The DBC has the message and all its signals.
    [[nodiscard]] static bool known(const proto::Dbc& dbc, const TorquerSettings& settings);

    /// False: the port took no frame.
    bool command(const std::array<double, 3>& deg_per_h) noexcept;
    /// Largest rate that the message can carry on every axis, deg/h.
    [[nodiscard]] double limit() const noexcept { return limit_; }
    [[nodiscard]] std::uint8_t counter() const noexcept { return counter_; }
    /// Nothing but zero has been commanded since the last zero.
    [[nodiscard]] bool zero() const noexcept { return zero_; }
    /// Somebody before this may have commanded what the platform still does.
    void doubt() noexcept { zero_ = false; }

  private:
    const proto::Message* message_ = nullptr;
    std::array<const proto::Signal*, 3> rates_{};
    const proto::Signal* counter_signal_ = nullptr;
    TorquerSettings settings_;
    CanPort& port_;
    double limit_ = 0;
    std::array<double, 3> rest_{};  ///< less than a count of the message, left for the next command
    std::uint8_t counter_ = 0;
    bool zero_ = true;
};

}  // namespace vibrig::drivers
