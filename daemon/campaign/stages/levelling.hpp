#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "daemon/campaign/position_leveller.hpp"
#include "daemon/campaign/stages/stage.hpp"

namespace vibrig::campaign {

/// Levels the platform on the rig at one position, and leaves it with nothing torqued.
class Levelling : public Stage {
  public:
    struct Aim {
        Vector encoder_deg{};
        ZeroStatus zeros;  ///< of the accelerometers
        /// The dwell that follows, to which the drift found belongs; none: no dwell does.
        std::optional<std::pair<int, int>> run_and_position;
    };

    /// `ports.rig` has a torquer and a feed. Throws as PositionLeveller does.
    Levelling(const Settings& settings, const Ports& ports)
        : ports_(ports),
          leveller_(settings.level, settings.rig, settings.sample_s, ports.rig.torquer->limit()) {}

    /// Where what begins next is.
    void aim(Aim aim) { aim_ = std::move(aim); }
    void begin(drivers::Time /*now*/) override { part_ = Part::go; }
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override { let_go(ports_.rig); }
    /// Encoders when it was level, rad.
    [[nodiscard]] const Vector& angle_rad() const { return angle_rad_; }
    [[nodiscard]] const PositionLeveller& leveller() const { return leveller_; }

  private:
    enum class Part : std::uint8_t { go, measure, zero };
    [[nodiscard]] StageStep measure(drivers::Time now);
    [[nodiscard]] StageStep confirm_zero(drivers::Time now);

    Ports ports_;
    PositionLeveller leveller_;
    Aim aim_;
    Part part_ = Part::go;
    Vector angle_rad_{};
    drivers::Time last_motion_ = 0, zero_since_ = 0, torque_sent_ = 0;
};

}  // namespace vibrig::campaign
