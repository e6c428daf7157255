#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/zeros/slew_plan.hpp"

namespace vibrig::estimator::zeros {

inline constexpr std::array<const char*, 15> kStateNames{
    "phi_E",  "phi_N", "phi_U", "dV_E",  "dV_N",  "dV_U",  "latitude", "longitude",
    "height", "eps_x", "eps_y", "eps_z", "nab_x", "nab_y", "nab_z"};

/// Rank and singular values of the scaled stripped observability matrix: 1e-3 rad, 1 m/s, 1 m, 0.1
/// deg/h, 1e-3 g, 30 s. Sufficient: rank 15 (singular values above 1e-10 of the largest) and no
/// singular value below 1e-5. The largest is no measure for the latter: it is the 30 s in which
/// velocity becomes position.
struct Observability {
    int rank = 0;
    std::array<double, 15> singular{};  ///< falling; 1 is a state measured once, directly
    std::array<double, 15> degree{};    ///< of each state; 0: not observable
    /// Combinations that are not observable, in scaled states.
    std::vector<std::array<double, 15>> null_vectors;

    [[nodiscard]] bool sufficient() const noexcept;
    /// States with a component above 0.3, "phi_E with nab_y; ...".
    [[nodiscard]] std::string unobservable() const;
};

/// Platform z up, standing at each of the azimuths in turn.
[[nodiscard]] Observability observability(const std::vector<double>& azimuths_deg,
                                          const Site& site);
/// A platform axis along the vertical.
struct Way {
    int upright = 2;
    bool down = false;
};
/// Rank of the 15 states together with what each accelerometer shows of 1 g along each axis that is
/// upright in one of the ways, by misalignment or scale: 18 at most with one axis, 21 with two.
/// Standing at each of the azimuths in each way.
[[nodiscard]] int rank_with_shares(const std::vector<double>& azimuths_deg,
                                   const std::vector<Way>& ways, const Site& site);
/// Throws ZeroError naming rank or weakest singular value, and the states in question.
void check_observable(const SlewPlan& plan, const Site& site);

}  // namespace vibrig::estimator::zeros
