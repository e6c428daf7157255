#pragma once

#include <stdexcept>
#include <vector>

/// Accelerometer zeros in place: the platform stands level with z up, its azimuth is turned to and
/// fro, and a 15-state filter on the strapdown error model tells zeros from tilt. Segments and
/// rank: Goshen-Meskin, Bar-Itzhack 1992.
namespace vibrig::estimator::zeros {

/// Names the quantity, the value found and what was expected.
class ZeroError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

struct Site {
    double latitude_rad = 0.7985;  ///< 45.75 deg
    double gravity_mps2 = 9.80665;
    double radius_m = 6378137;
};

/// Azimuth, positive about up: from targets[0] to targets[1] and so on; the last two are repeated
/// until the end. Without a second target the platform stands.
struct SlewPlan {
    std::vector<double> targets_deg{0, 90, -90, 90};
    double rate_deg_s = 5;
    double duration_s = 180;

    [[nodiscard]] bool turns() const noexcept;
    [[nodiscard]] double azimuth_deg(double time_s) const noexcept;
    /// There and back between the last two targets, s; the whole duration where nothing turns.
    [[nodiscard]] double sweep_s() const noexcept;
    /// Azimuths at which the platform turns round or ends, each once.
    [[nodiscard]] std::vector<double> segments_deg() const;
    /// Throws ZeroError.
    void check() const;
};

}  // namespace vibrig::estimator::zeros
