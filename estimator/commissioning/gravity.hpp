#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/commissioning/rig.hpp"

namespace vibrig::estimator::commissioning {

/// What is believed of a rig before it is measured, and how sure a decision must be.
struct GravitySettings {
    double force_sigma_g = 1.5e-3;  ///< gimbal axes not square, wobble; noise is far below
    double elevation_sigma_deg = 1, zero_sigma_g = 10e-3, gain_sigma = 0.02,
           misalignment_sigma_arcmin = 20;
    double rms_g = 1.5e-3;            ///< accepted up to it
    double rms_with_second_g = 4e-3;  ///< with two persons, since gimbals are not square
    double ln_ratio = 25;             ///< asked over the next class
    double elevation_deg = 2, zero_g = 30e-3, gain = 0.05, misalignment_deg = 1;
    double dead_g = 30e-3;  ///< an accelerometer that spreads less over all stops
};

/// A class of descriptions: which channel is which gimbal, units, product of the signs.
struct Hypothesis {
    Description best;  ///< of the class; signs (1, 1, product)
    double cost = 0;   ///< -2 ln posterior; at least, where it is far beyond the best
    double rms_g = 0;
    double ln_ratio = 0;  ///< under the best class, 0 or below
    [[nodiscard]] int sign_product() const { return best.sign[2]; }
};

enum class Verdict : std::uint8_t { decided, undecided, refused };

struct GravityFinding {
    Verdict verdict = Verdict::undecided;
    std::string why;                        ///< not decided, or only with two persons
    bool second_person = false;             ///< decided, but asked for
    std::vector<Hypothesis> hypotheses;     ///< best first
    std::array<std::vector<int>, 3> units;  ///< kept after the sweeps, by channel
};

/// Names the description of a rig by gravity alone, out of 6 assignments of the channels, 2
/// products of the encoders' signs and the units that its sweeps leave (docs/commissioning.md,
/// "Gravity"). Equals of the winner: family_of(). Throws std::invalid_argument for fewer than 8
/// stops, a channel without a sweep of 3, or what is not finite.
[[nodiscard]] GravityFinding find_by_gravity(const std::vector<Stop>& stops,
                                             const GravitySettings& settings = {});

/// How badly circles fit a sweep of one channel, in each unit: -2 ln likelihood, lowest 0.
[[nodiscard]] std::vector<double> unit_scores(const std::vector<Stop>& sweep, std::size_t channel);

/// A position that tells two descriptions apart, and by how much.
struct Separation {
    Vec3 reading{};
    double by_g = 0;
};
/// The best of 60 within the limits (readings, [lowest, highest] of each channel).
[[nodiscard]] Separation separating_position(const Description& a, const Description& b,
                                             const std::array<std::array<double, 2>, 3>& limits,
                                             std::uint64_t seed = 1);

}  // namespace vibrig::estimator::commissioning
