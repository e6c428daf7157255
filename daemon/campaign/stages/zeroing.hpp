#pragma once

#include <cstdint>

#include "daemon/campaign/stages/stage.hpp"
#include "daemon/campaign/zero_calibration.hpp"

namespace vibrig::campaign {

/// The accelerometers' zeros on the rig, by azimuth slews: before the first dwell, and again after
/// the last one.
class Zeroing : public Stage {
  public:
    /// `levels`: it asks for the platform to be levelled before the slews of each way. Throws as
    /// ZeroCalibration does.
    Zeroing(const Settings& settings, Rig& rig, Log& log, bool levels)
        : rig_(rig),
          log_(log),
          calibration_(settings.zero, settings.rig, settings.sample_s),
          levels_(levels) {}

    /// Whether what begins next compares with the campaign's start.
    void at_end(bool at_end) { at_end_ = at_end; }
    void begin(drivers::Time now) override;
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override { let_go(rig_); }
    /// The platform was levelled where the slews begin, at these encoder angles.
    void levelled_at(const Vector& encoder_rad);
    void reset() { calibration_.reset(); }  ///< a new campaign
    [[nodiscard]] const ZeroCalibration& calibration() const { return calibration_; }

  private:
    enum class Part : std::uint8_t { go, slew, measure };
    [[nodiscard]] StageStep measure(bool there, drivers::Time now);
    [[nodiscard]] StageStep end(drivers::Time now);

    Rig& rig_;
    Log& log_;
    ZeroCalibration calibration_;
    bool levels_, at_end_ = false;
    Part part_ = Part::go;
    drivers::Time last_motion_ = 0;
};

}  // namespace vibrig::campaign
