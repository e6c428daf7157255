#pragma once

#include <cstdint>
#include <optional>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {

enum class GimbalMode : std::uint8_t {
    free_drift = 0,
    slew = 1,
    calibrate = 2  ///< slew, and the platform sends increments
};

/// Where gimbals stop by themselves, encoder deg: this far from the middle.
struct SoftStops {
    Vec3 middle_deg{}, reach_deg{360, 360, 360};
};

/// Servo of the three gimbals: slews to encoder angles at a finite rate and holds (caged), or lets
/// the platform go.
class Gimbals {
  public:
    explicit Gimbals(double rate_deg_per_s, std::optional<GimbalAxis> stuck = std::nullopt,
                     const SoftStops& stops = {})
        : rate_(rate_deg_per_s), stuck_(stuck), stops_(stops) {}

    /// Target in encoder degrees, any turn of it; taken the shorter way round.
    void slew_to(const Vec3& encoder_deg, GimbalMode mode = GimbalMode::slew) noexcept;
    void release() noexcept { mode_ = GimbalMode::free_drift; }

    /// Moves encoder angles (deg) on by dt; nothing in free drift. True if a slew came to its end
    /// in this step.
    bool advance(double dt_s, Vec3& encoder_deg) noexcept;

    [[nodiscard]] GimbalMode mode() const noexcept { return mode_; }
    [[nodiscard]] bool slewing() const noexcept {
        return mode_ != GimbalMode::free_drift && moving_;
    }
    [[nodiscard]] bool in_position() const noexcept {
        return mode_ != GimbalMode::free_drift && !moving_;
    }

  private:
    double rate_;
    std::optional<GimbalAxis> stuck_;
    SoftStops stops_;
    Vec3 target_{};
    GimbalMode mode_ = GimbalMode::slew;  ///< caged at switch-on
    bool moving_ = false;
};

}  // namespace vibrig::plant
