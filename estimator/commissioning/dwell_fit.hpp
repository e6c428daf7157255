#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/commissioning/consistency.hpp"

namespace vibrig::estimator::commissioning {

/// Dwell-mean rates by 30 coefficients and the Earth's horizontal rate.
struct RateFit {
    double north = 0, east = 0, sigma = 0;  ///< beyond the settings', deg/h
    double dilution = 0;                    ///< sigma by the attitudes alone, in those of one rate
    double rest = 0;                        ///< rms of the residual per degree of freedom, deg/h
    double rest_by_chance = 0;              ///< what noise alone exceeds once in 3 million times
    double input_mean = 0;                  ///< of the three input-axis terms, deg/h/g
    double cost = 0;                        ///< -2 ln posterior
    bool known = false;
};
/// What is believed: `earth` of north and east (deg/h), `linear` of the linear terms (deg/h/g).
struct RatePriors {
    double earth = 1e3, linear = 20;
};
/// `time_factor`: what all slopes are too large by.
[[nodiscard]] RateFit fit_rates(const Settings& settings, const std::vector<DwellMean>& dwells,
                                const RatePriors& priors, double time_factor = 1);

/// Direction of the mean force in platform axes, and of the vertical by the encoders.
struct Verticals {
    Eigen::Vector3d force, encoders;
    [[nodiscard]] double apart_deg() const;
};
[[nodiscard]] std::vector<Verticals> verticals(const Settings& settings,
                                               const std::vector<DwellMean>& dwells);

}  // namespace vibrig::estimator::commissioning
