#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/levelling/leveller.hpp"

namespace vibrig::estimator::levelling {

/// `bare`: the fast gains as they are, also with k3 = 0 (eq. 8), without the loop's checks.
enum class Network : std::uint8_t { undamped, conventional, fast, bare };

/// The carrier speeds up, or slows down.
struct Manoeuvre {
    double from_s = 0, until_s = 0;
    Pair acceleration_mps2{};
};

/// A simulated start: two channels with what is wrong with them, at rest or on a carrier.
struct Scenario {
    LevellerSettings loop;
    Network network = Network::fast;
    std::vector<Manoeuvre> motion;  ///< from rest
    /// Internal damping (eq. 1): the network has no reference velocity, and so 0 for one.
    bool internal = false;
    Pair tilt{};                   ///< at the start, rad
    Pair drift{};                  ///< rad/s
    Pair zero{};                   ///< of the accelerometers, m/s^2
    Pair reference_error{};        ///< constant, m/s
    double reference_error_s = 0;  ///< from then on; the loop begins at the reference
    /// Velocity of the network less the reference at first, m/s; Network::fast begins at the
    /// reference.
    Pair start_velocity{};
    double step_s = -1;  ///< when the platform tips; negative: never
    Pair step{};         ///< by how much, rad
    double duration_s = 600;
    bool until_settled = false;
    std::uint64_t seed = 1;
};

struct TracePoint {
    double time_s = 0;
    Pair tilt{};  ///< true, rad
    Pair rate{};  ///< commanded, rad/s
};

/// `trace` holds every step; the noise is loop.noise, drawn from the seed.
struct SimulatedStart {
    std::vector<TracePoint> trace;
    Verdict verdict = Verdict::settling;
    double settled_s = -1;
    Pair tilt_when_settled{};  ///< true, rad
    Pair drift{};              ///< found, rad/s
    Leveller::Observables observables;
    std::string message;

    /// Last time at which the first channel's tilt was above the fraction of its start, s.
    [[nodiscard]] double last_above(double fraction) const noexcept;
    /// Standard deviation of the first channel's tilt about its mean, rad.
    [[nodiscard]] double tilt_deviation() const noexcept;
};

[[nodiscard]] SimulatedStart simulate(const Scenario& scenario);

/// Time, s, within which a start with tilt (rad) and drift (rad/s) up to these in both channels is
/// declared settled; at most one in twenty is more than 5 % late. Response of the loop into the
/// bands less three standard deviations of the observables, window and hold time; at least settling
/// time + window + 1/sigma. Empty: the loop does not wait so long, or cannot settle.
[[nodiscard]] std::optional<double> declared_within_s(const LevellerSettings& loop, double tilt,
                                                      double drift);

}  // namespace vibrig::estimator::levelling
