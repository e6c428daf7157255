#pragma once

#include <array>
#include <vector>

#include "estimator/spectrum/resonance.hpp"
#include "estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {

/// Where a resonance that was found is to be looked at; all in Hz.
struct About {
    std::size_t gyro = 0;
    double resonance_hz = 0;
    double below_hz = 0, above_hz = 0;
};

/// Below and above each resonance of each gyro whose elastic part is named (log odds above 4) the
/// frequency at which it shows most: where the mean over the gyro's mixture of the in-phase
/// response is largest, and where it is smallest; of one resonance that is known they are
/// f_r sqrt(1 -+ 2 damping), where the response is +-1/(4 damping), and does not change with f_r.
/// In steps of 0.1 Hz, of those frequencies that are free of the samples up to their eighth
/// harmonic, 1 % off the resonance at least, and 2 % off one another and those `beside`; one that
/// is planned already serves where it has half of the best one's information. Throws
/// plan::PlanError where nothing is named, or no frequency is left on a side.
[[nodiscard]] std::vector<About> about_resonances(
    const std::array<std::vector<Hypothesis>, 3>& mixtures, const Sampling& sampling,
    std::vector<double> beside);

/// All of them, growing, each once.
[[nodiscard]] std::vector<double> frequencies_of(const std::vector<About>& about);

}  // namespace vibrig::estimator::spectrum
