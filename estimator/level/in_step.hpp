#pragma once

#include <array>
#include <span>

#include "estimator/filter/settings.hpp"
#include "estimator/level/loop_response.hpp"

namespace vibrig::estimator {

/// What goes in step with a vibration along the vertical: how far the encoders move with it, and
/// how much of it goes across. Of a few seconds at a steady level.
struct InStep {
    double platform_g = 0;  ///< along the vertical, peak, as the accelerometers show it; 0: unknown
    /// Motion of the gimbals outer, inner, azimuth, peak, arcsec, noise and all.
    std::array<double, 3> gimbal_arcsec{};
    /// Per g of platform_g: the turn of the platform against its base, peak, which is the same at
    /// every position, noise's share taken out; and what noise does to the in-phase and quadrature
    /// part of each of its three components, 1 sigma.
    double motion_arcsec_g = 0, motion_sigma = 0;
    double cross_share = 0;  ///< peak across the vertical over peak along it
    double cross_sigma = 0;  ///< likewise, of each of two components
    double distortion = 0;   ///< as in LoopResponse
};

/// SyncMotion of the readings' angles less their straight line, and loop_response_at(), at `hz`;
/// docs/theory/spectrum.md, growth since the loop check. An encoder's noise is taken as what is
/// left beside line and sine, and as what `settings` say at least. Readings as for loop_response();
/// unknown where the platform does less than 0.005 g.
[[nodiscard]] InStep in_step(std::span<const LoopReading> readings, double hz,
                             const Settings& settings);

/// What of a share or a motion has grown, over what was found before, as far as neither noise nor
/// what is known of the instruments explains it.
struct Growth {
    double expected = 0;  ///< what was found before, with a kGrown-th of the allowance
    double times = 0;     ///< what is found now, over that: beyond kGrown it has grown
    static constexpr double kGrown = 3;
};
/// Growth of the motion per g of vibration: never beyond kGrown by chance but once in 1e9.
[[nodiscard]] Growth motion_growth(const InStep& before, const InStep& now);
/// Growth of the cross share; the allowance has in it what `settings` declare of accelerometers:
/// zeros, gains at one frequency, skew.
[[nodiscard]] Growth cross_growth(const InStep& before, const InStep& now, double hz,
                                  const Settings& settings);

}  // namespace vibrig::estimator
