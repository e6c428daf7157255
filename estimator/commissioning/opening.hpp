#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/commissioning/consistency.hpp"

namespace vibrig::estimator::commissioning {

/// Where the platform drifts freely, gimbal angles in deg: the azimuth axis upright, four ways
/// round; and where gravity alone is looked at, all gimbals turned.
inline constexpr std::array<std::array<double, 3>, 4> kOpeningDrifts_deg{
    {{90, 0, 0}, {90, 0, 90}, {90, 0, 180}, {90, 0, 270}}};
inline constexpr std::array<double, 3> kOpeningGravity_deg{60, 15, 90};

struct OpeningLimits {
    double warn_deg_h = 0.1;     ///< Earth rate north and east against the site, or 5 sigma
    double refused_deg_h = 0.5;  ///< likewise
    double known_deg_h = 0.1;    ///< sigma of both, at most
    double rest_chi2 = 100;      ///< of what the Earth and a fixed drift leave
    /// Drift about the vertical: fixed and linear terms, 2 and 1 deg/h (/g) of usual gyros.
    double warn_vertical_deg_h = 6, refused_vertical_deg_h = 9;
    double warn_deg = 0.2, refused_deg = 0.5;  ///< vertical by the encoders against the mean force
    double rate_sigma = 0.02;                  ///< of one slope, deg/h
};

/// A configuration held against the rig at rest. Of a stop without free drift `level_known` is
/// false.
struct Opening {
    bool earth_known = false;                ///< three free drifts at least
    double north_deg_h = 0, east_deg_h = 0;  ///< measured less what the site's keys give
    double sigma_deg_h = 0;                  ///< the larger of both
    double rest_chi2 = 0;                    ///< 7 degrees of freedom with four drifts
    double vertical_deg_h = 0;
    double gravity_deg = 0;                    ///< worst stop
    std::vector<std::string> refused, warned;  ///< in words; empty: it fits
};
/// Throws SettingsError.
[[nodiscard]] Opening hold_at_rest(const Settings& settings, const std::vector<DwellMean>& stops,
                                   const OpeningLimits& limits = {});

/// As suspects(), for stops at rest.
[[nodiscard]] std::vector<Suspect> suspects_at_rest(const Settings& settings,
                                                    const std::vector<DwellMean>& stops,
                                                    const OpeningLimits& limits = {},
                                                    std::size_t most = 3);

}  // namespace vibrig::estimator::commissioning
