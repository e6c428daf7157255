#pragma once

#include <array>
#include <optional>

#include "daemon/app/fitness.hpp"
#include "daemon/app/parts.hpp"
#include "daemon/commission/rig.hpp"

namespace vibrig {

/// The real rig, or the simulated one, as commissioning may have it.
class CommissionRig final : public commission::Rig {
  public:
    explicit CommissionRig(Parts& parts) : parts_(parts) {}

    [[nodiscard]] commission::Look sample() override;
    [[nodiscard]] commission::Look second() override;
    [[nodiscard]] std::optional<commission::SampleRate> rate() override;

    [[nodiscard]] drivers::GimbalState gimbal() override { return parts_.gimbal.state(); }
    void slew(const commission::Vec3& command_deg, drivers::Time now) override {
        slew(command_deg, now, false);
    }
    void release(drivers::Time now) override { parts_.gimbal.release(now); }

    [[nodiscard]] bool has_torquers() const override { return parts_.torquer != nullptr; }
    void torque(const commission::Vec3& deg_per_h) override;

    /// Increments are the input of zeroing.
    [[nodiscard]] bool has_increments() const override {
        return parts_.configuration.campaign.zeroing;
    }
    void count() override;
    [[nodiscard]] commission::Vec3 counted() override;
    void slew_counting(const commission::Vec3& command_deg, drivers::Time now) override {
        slew(command_deg, now, true);
    }

    /// With each round: what the gyros have counted since the one before.
    void take_increments();

  private:
    void slew(const commission::Vec3& command_deg, drivers::Time now, bool counting);

    Parts& parts_;
    std::array<double, 3> counted_rad_{};
};

}  // namespace vibrig
