#pragma once

#include <optional>
#include <string>

#include "daemon/commission/finding.hpp"
#include "daemon/domain/events.hpp"
#include "drivers/base/clock.hpp"
#include "drivers/gimbal/gimbal.hpp"

namespace vibrig::commission {

/// The newest sample, or the mean of a second, as the bus says: angles in deg, g.
struct Look {
    drivers::Time from = 0, to = 0;
    Vec3 angle{}, force{};
    bool good = false;
};

/// Samples a second: counted against the kernel's stamps, and as configured.
struct SampleRate {
    double measured_hz = 0, configured_hz = 0;
    std::string why{};  ///< they do not fit, or it is not measured; empty: they do
};

/// The rig, as a procedure may have it. Control thread.
class Rig {
  public:
    Rig() = default;
    Rig(const Rig&) = delete;
    Rig& operator=(const Rig&) = delete;
    virtual ~Rig() = default;

    [[nodiscard]] virtual Look sample() = 0;
    [[nodiscard]] virtual Look second() = 0;
    [[nodiscard]] virtual std::optional<SampleRate> rate() = 0;  ///< none: nobody measures it

    [[nodiscard]] virtual drivers::GimbalState gimbal() = 0;
    virtual void slew(const Vec3& command_deg, drivers::Time now) = 0;
    virtual void release(drivers::Time now) = 0;

    [[nodiscard]] virtual bool has_torquers() const = 0;
    /// By the commands' names, as they are sent: without levelling.torque_sign.
    virtual void torque(const Vec3& deg_per_h) = 0;

    /// Whether the gyros' increments are on the bus.
    [[nodiscard]] virtual bool has_increments() const = 0;
    virtual void count() = 0;                  ///< the gyros' turn, from now on
    [[nodiscard]] virtual Vec3 counted() = 0;  ///< deg since then; it ends
    /// As `slew`, while they count.
    virtual void slew_counting(const Vec3& command_deg, drivers::Time now) = 0;
};

/// For the journal: what was done, asked or found at which step.
struct Note {
    std::string part, step, by;
    std::string what;  ///< begin, permission, move, reading, hypothesis, question, answer, verdict
    Json data = Json::object();
};

/// Who keeps what a procedure does. Control thread.
class Keeper {
  public:
    Keeper() = default;
    Keeper(const Keeper&) = delete;
    Keeper& operator=(const Keeper&) = delete;
    virtual ~Keeper() = default;

    virtual void event(const std::string& text) = 0;
    virtual void note(const Note& note) = 0;
    /// What was answered and measured so far, on disk when this returns:
    /// Procedure::begin_again() takes it.
    virtual void keep(const Json& log) = 0;
};

}  // namespace vibrig::commission
