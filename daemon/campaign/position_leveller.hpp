#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "daemon/status/status.hpp"
#include "estimator/levelling/leveller.hpp"

namespace vibrig::campaign {

/// Samples per step of the loop, about 0.1 s; `sample_s`: between two of them. Throws
/// std::invalid_argument where that is not above 0.
[[nodiscard]] std::uint32_t levelling_block(double sample_s);

/// Levels the platform at one position: the two channels are the platform directions normal to the
/// position's nominal vertical. Control thread only.
class PositionLeveller {
  public:
    /// Throws estimator::levelling::DesignError, with the key of [levelling].
    PositionLeveller(const LevellingSettings& settings, const estimator::Settings& rig,
                     double sample_s, double torquer_limit_deg_h);

    /// Which key of [levelling] cannot work with the noise, what was found and expected; empty:
    /// none.
    [[nodiscard]] std::string refusal() const;
    /// `zeros`: of the accelerometers, platform axes.
    void begin(const Vector& encoder_deg, const ZeroStatus& zeros);
    /// Torquing rates in platform axes, deg/h, that answer this mean.
    [[nodiscard]] Vector step(const rt::Motion& motion);
    [[nodiscard]] bool done() const;
    /// Why it has failed; empty: it has not.
    [[nodiscard]] std::string failure() const;
    /// What it has found, for the log.
    [[nodiscard]] std::string words() const;
    /// What the free platform drifted by at these encoder angles; without run and position.
    [[nodiscard]] LevelDrift drift(const Vector& encoder_rad) const;
    void fill(LevellingStatus& status) const;
    /// s, by design
    [[nodiscard]] double expected_s() const noexcept;

  private:
    [[nodiscard]] Vector to_axes(const estimator::levelling::Pair& rate) const;

    LevellingSettings settings_;
    estimator::Settings rig_;
    RigFrame frame_;
    estimator::levelling::LevellerSettings loop_;
    std::optional<estimator::levelling::Leveller> leveller_;
    std::array<Vector, 2> channel_{};
    std::array<Vector, 2> north_east_{};  ///< platform axes
    Vector zero_g_{};
    double largest_at_first_ = 0;  ///< |tilt|, rad
    double limit_rad_ = 0;
    std::uint32_t done_ = 0;
    bool counted_ = false;
};

}  // namespace vibrig::campaign
