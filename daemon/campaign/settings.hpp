#pragma once

#include <array>
#include <string>
#include <vector>

namespace vibrig::campaign {

/// Table 1 of Tang et al. 2009: outer, inner, azimuth in deg.
inline const std::vector<std::array<double, 3>> kTable1Positions{
    {0, 0, 0},   {0, 0, 45},   {0, 0, 90},    {0, 0, 180}, {180, 0, 45}, {45, 0, 0},  {45, 0, 90},
    {90, 0, 90}, {90, 0, 180}, {180, 0, 270}, {270, 0, 0}, {270, 0, 90}, {-45, 0, 0}, {-45, 0, 90}};

/// One dwell of a campaign.
struct Stop {
    std::array<double, 3> position_deg{};
    double table_g = 0;
};

/// What the campaign does; amplitudes are peak at the table.
struct Settings {
    std::string name = "campaign";
    std::vector<std::array<double, 3>> positions_deg = kTable1Positions;
    std::vector<double> table_g{9.0, 7.0};  ///< one run each
    std::string plan;                       ///< plan file; empty: every position at every level
    std::vector<Stop> stops;                ///< of the plan file, in its order
    bool identify_all = true;  ///< refuse a campaign that cannot determine all 30 coefficients
    std::string refusal;       ///< why this one is refused; empty: it is not
    // Adaptive: chosen dwell by dwell until the standard errors are down to the targets (0: any).
    bool adaptive = false;
    double target_bias = 0;       ///< deg/h
    double target_linear = 0;     ///< deg/h/g
    double target_quadratic = 0;  ///< deg/h/g^2
    double time_limit_s = 0;      ///< of an adaptive campaign; 0: none
    double frequency_hz = 15.0;   ///< [vibration] frequency_hz
    double dwell_s = 100.0;
    double settle_s = 3.0;  ///< after the ramp, 2 s at least
    double ramp_s = 2.0;
    double ready_timeout_s = 600.0;  ///< platform ready and temperature steady
    double temperature_window_s = 60.0;
    double temperature_band_c = 0.5;    ///< largest spread within the window
    double amplitude_tolerance = 0.05;  ///< relative; measured against commanded after the ramp
    double stop_timeout_s = 10.0;       ///< from stop to rest
    // limits of the shaker, checked at the frequency in force
    double max_acceleration_g = 12.0;
    double max_velocity_mps = 1.5;
    double max_displacement_mm = 12.0;  ///< peak
    double resonance_hz = 0.0;          ///< of the isolators; 0: from frequency and transmission
};

}  // namespace vibrig::campaign
