#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/allan/noise_terms.hpp"

namespace vibrig {

/// Noise of the gyros as seen in the dwells so far.
struct NoiseStatus {
    struct Gyro {
        std::array<estimator::allan::FittedTerm, estimator::allan::kTerms> terms{};
        double in_force = 0;         ///< N of the filter, deg/sqrt(h)
        double smallest_change = 0;  ///< of N, times, that one dwell shows; 0: not known
        std::vector<estimator::allan::DwellPoint> points;
    };
    struct Alarm {
        int run = 0, position = 0;
        std::size_t gyro = 0;
        double tau_s = 0, ratio = 1, limit = 1;  ///< of a step of the mean in standard deviations
        const char* reading = "";
    };
    /// Curve of one dwell, those with an alarm too.
    struct Curve {
        int run = 0, position = 0;
        bool alarm = false;
        std::vector<double> tau_s;
        std::array<std::vector<double>, 3> deviation_deg_h;  ///< by gyro
        std::array<std::vector<double>, 3> classical_deg_h;  ///< about the dwell's own mean
    };
    static constexpr std::size_t kMostCurves = 128;
    std::array<Gyro, 3> gyros;
    /// The dynamic surface: the newest dwells, oldest first; never null.
    std::shared_ptr<const std::vector<Curve>> surface =
        std::make_shared<const std::vector<Curve>>();
    double angle_in_force_arcsec = 0;
    double block_s = 0;
    std::uint32_t dwells = 0, dwells_left_out = 0;  ///< left out: flagged, too short or alarmed
    std::uint64_t alarms_total = 0;
    std::vector<Alarm> alarms;  ///< the newest
    /// Drifts found while levelling against what the coefficients say.
    struct Level {
        std::uint32_t samples = 0;
        double mean_square = 0;     ///< of the normalised innovations, 1 when consistent
        int run = 0, position = 0;  ///< of the newest
        std::array<double, 2> innovation_deg_h{}, sigma_deg_h{};
    } level;
};

}  // namespace vibrig
