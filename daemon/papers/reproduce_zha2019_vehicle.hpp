#pragma once

#include <array>
#include <cstdint>

#include "daemon/papers/reproduce.hpp"
#include "estimator/levelling/simulation.hpp"

namespace vibrig::tool::zha2019::drives {

constexpr double kDrive_s = 4 * 3600;
constexpr estimator::levelling::Gains kPrinted{0.0264, 156.063, 0.904};

struct Way {
    const char* name;
    estimator::levelling::Network network;
    bool internal = false;
};
inline constexpr std::array<Way, 3> kWays{
    {{"no network", estimator::levelling::Network::undamped},
     {"conventional network", estimator::levelling::Network::conventional},
     {"fast network", estimator::levelling::Network::bare}}};

/// At rest, both channels tilted.
[[nodiscard]] estimator::levelling::Scenario start(const Way& way,
                                                   const estimator::levelling::Gains& gains,
                                                   double tilt_arcmin, double duration_s);
/// A drive: every 5 to 15 minutes the vehicle starts, turns or stops, within 20 s by up to 15 m/s
/// in each direction. The reference is 0.2 m/s noisy at 1 Hz; gyros drift 0.01 deg/h.
[[nodiscard]] estimator::levelling::Scenario drive(const Way& way,
                                                   const estimator::levelling::Gains& gains,
                                                   std::uint64_t seed);

/// Six simulated drives in place of the paper's, whose data are not published: rows for Tables 1
/// and 2, and what damping without a reference does under way (eq. 1, Figure 2).
void add_vehicle(Reproduction& table);
/// Charts of the networks, of starts, the four hours and a drive.
void add_charts(Reproduction& table);

}  // namespace vibrig::tool::zha2019::drives
