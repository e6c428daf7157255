#pragma once
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/results/text_line.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/levelling/simulation.hpp"

namespace vibrig::tool::level_command {

namespace levelling = estimator::levelling;
using Json = nlohmann::ordered_json;
using estimator::kDegPerHour;
using estimator::kRadPerArcmin;
using levelling::Pair;

/// As typed; angles in arcmin, rates in deg/h.
struct Options {
    levelling::Specification specification;
    std::vector<double> gains;
    double period_s = 0.1;
    double window_s = 1;
    double tolerance = 0;
    double gravity = 9.80665;
    double reference_noise = 0;
    double accelerometer_noise_g = 1e-5;
    double gyro_noise = 0;  ///< deg/sqrt(h)
    bool json = false;
    std::string plot;
    // simulate
    std::vector<double> tilt{30, -20};
    std::vector<double> drift{0.1, -0.1};
    std::vector<double> zero_mg{0, 0};
    std::vector<double> reference_error{0, 0};
    std::vector<double> slow;
    double ramp_s = 60;
    double step = 0;
    double step_s = -1;
    double duration_s = 0;
    double torquer_limit = 3276.7;  ///< what TorqueCommand can carry
    std::string network = "fast";
    std::uint64_t seed = 1;
    std::size_t runs = 1;
};

inline Pair pair(const std::vector<double>& list, double unit) {
    return {list[0] * unit, list[1] * unit};
}

/// Throws levelling's errors of a specification that no gains meet.
levelling::LevellerSettings settings_of(const Options& options);

/// Throws std::invalid_argument where that many samples would take for ever.
void check_samples(const char* option, double duration_s, double period_s);

/// Settling time of the start with the largest tilt and drift that the options allow, s.
std::optional<double> declared_within(const Options& options,
                                      const levelling::LevellerSettings& loop);

Json budget_json(const levelling::Leveller& loop);
Json gains_json(const levelling::Gains& gains);
std::string budget_table(const levelling::Leveller& loop);

/// Each prints what was asked for and returns the exit code.
int run_design(const Options& options);
int run_simulate(const Options& options);

}  // namespace vibrig::tool::level_command
