#pragma once

#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/interlock/mean_motion.hpp"

namespace vibrig::campaign {

/// Limits of the angle between the vertical by the encoders and the mean force, and of its size.
struct GravityLimits {
    double warn_deg = 0.2;
    double refused_deg = 0.5;
    double size = 0.02;  ///< of 1 g, at rest
    /// Limit of the vibration against the vertical by the encoders, from so much on, peak. Motion
    /// across the vertical of a quarter of that along it, which the identification accounts for, is
    /// 14 deg.
    double vibration_deg = 15, vibration_g = 0.3;
};

/// Holds gravity and the vibration against the encoders, second by second, and names the keys that
/// would explain what does not fit. Control thread only.
class GravityWatch {
  public:
    GravityWatch(const estimator::Settings& rig, const GravityLimits& limits);

    struct Verdict {
        bool known = false;
        double angle_deg = 0, size_g = 1;
        bool warned = false, refused = false;
        bool size_off = false;  ///< it is the size that is wrong, or that as well
        double vibration_g = 0, vibration_deg = 0;  ///< peak; off the vertical, 0 when too small
        bool vibration_off = false;
    };
    /// A new position: it is remembered apart from the earlier ones.
    void next_position() noexcept { fresh_ = true; }
    /// Only a good second; `zero_g`: raw, the configuration's and what was found since. The size
    /// counts at rest.
    Verdict judge(const rt::MeanMotion& second, const Vector& zero_g, bool at_rest);
    [[nodiscard]] const Verdict& newest() const noexcept { return newest_; }
    /// In words, with its limits.
    [[nodiscard]] std::string words() const;
    [[nodiscard]] std::string vibration_words() const;
    /// Keys of which one alone, changed, would bring all positions so far within the limits, best
    /// first, three at most; empty: none.
    [[nodiscard]] std::string suspects() const;

  private:
    struct Look {
        Vector encoder_rad{}, force{};  ///< platform axes
    };
    /// How far each explanation leaves the worst position from its limits, deg, and its words.
    using Suspects = std::vector<std::pair<double, std::string>>;
    [[nodiscard]] double worst_deg(const estimator::Settings& rig) const;
    /// Takes it where it explains all positions.
    void consider(Suspects& found, double worst, std::string words) const;
    void consider_encoder(Suspects& found, std::size_t gimbal) const;
    void consider_accelerometers(Suspects& found) const;
    void consider_up(Suspects& found) const;

    estimator::Settings rig_;
    GravityLimits limits_;
    RigFrame frame_;
    Verdict newest_;
    std::deque<Look> looks_;  ///< of the last positions
    bool fresh_ = true;
};

}  // namespace vibrig::campaign
