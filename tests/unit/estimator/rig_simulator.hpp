#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <random>

#include "estimator/identification/identification.hpp"

namespace vibrig::estimator::testing {

constexpr double kRad = 3.14159265358979323846 / 180.0;  ///< of a degree

/// Positions of Tang et al. 2009, Table 1: alpha, beta, gamma, deg.
extern const std::array<std::array<double, 3>, 14> kTable1;
/// Table 2 in the order of parameter_names().
extern const std::array<double, kParameters> kTable2;

struct SimulatedDwell {
    DwellInfo info;
    std::array<double, 3> angles_deg{};
    double amplitude_g = 6;  ///< at the platform
    double frequency_hz = 15;
    double second_harmonic = 0;  ///< of the fundamental
    double duration_s = 100;
    double period_s = 0.025;
    double spike_probability = 0;  ///< per angle, 0.5 deg
    double lost_probability = 0;   ///< per sample
    double force_scale = 1;
    double cross_north = 0, cross_east = 0;  ///< in phase, of the vertical vibration
    double amplitude_drift = 0;              ///< relative growth of the amplitude over the dwell
    double late_s = 0;                       ///< the vibration starts so late ...
    int late_position = 0;                   ///< ... in this position of the first run
};

/// A rig of its own: up = +y, cyclic gyro axes, drift sign -1, latitude 45.75 deg, written a second
/// time and from the original model, with the vibration explicit; shares no code with the
/// estimator.
class RigSimulator {
  public:
    explicit RigSimulator(std::uint64_t seed) : random_(seed) {}

    std::array<double, kParameters> truth = kTable2;
    double resolver_arcsec = 5, random_walk_deg_per_rt_h = 0.001, force_noise_g = 1e-4;
    bool quantise = true;
    /// Noise as the running mean of so many draws: of the encoders (which makes it smaller) and of
    /// the gyros (Tang et al. 2009, eq. 9; the walk over long times stays).
    std::size_t encoder_average = 1, gyro_average = 1;
    /// May change the measurement with this number in its dwell before it is fed.
    std::function<void(const DwellInfo&, int, Measurement&)> spoil;

    /// Feeds one dwell, from begin_dwell to end_dwell.
    DwellSummary dwell(Identification& to, const SimulatedDwell& plan);
    /// All positions of Table 1 at the given amplitudes, one run each.
    void campaign(Identification& to, std::array<double, 2> amplitudes_g, SimulatedDwell plan = {});

  private:
    static constexpr std::size_t kMostAveraged = 16;
    using History = std::array<std::array<double, kMostAveraged>, 3>;

    double gauss() { return normal_(random_); }
    /// Running mean of `count` draws.
    double averaged(History& history, std::size_t axis, std::size_t n, std::size_t count);

    History encoder_noise_{}, gyro_noise_{};
    std::mt19937_64 random_;
    std::normal_distribution<double> normal_;
    std::uniform_real_distribution<double> uniform_;
};

}  // namespace vibrig::estimator::testing
