#pragma once

#include <span>

namespace vibrig::estimator::spectrum {

/// An elastic path: its natural frequency, and its damping over the critical one.
struct Resonance {
    double hz = 0, damping = 0;
};

/// What part of the elastic coefficient a vibration of this frequency sees: the in-phase response
/// of the mass, 1 far below the resonance, 0 far above it.
[[nodiscard]] inline double in_phase(double hz, const Resonance& of) noexcept {
    const double r = hz / of.hz;
    const double stiff = 1 - r * r, damped = 2 * of.damping * r;
    return stiff / (stiff * stiff + damped * damped);
}

/// A part of a vibration's second moment; of no width: a sine.
struct Band {
    double hz = 0, share = 1, width_hz = 0;
};

/// Weight of a whole vibration, less 1: what the elastic part adds to the static coefficient. At
/// rest 0.
[[nodiscard]] inline double elastic_weight(std::span<const Band> bands,
                                           const Resonance& of) noexcept {
    double sum = 0;
    for (const Band& band : bands) sum += band.share * (in_phase(band.hz, of) - 1);
    return sum;
}

}  // namespace vibrig::estimator::spectrum
