#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace vibrig::estimator::uncertainty {

enum class Shape : std::uint8_t { normal, rectangular, triangular, arcsine };

/// What is known of an input that the data do not determine: its standard uncertainty and the
/// distribution it is drawn from.
struct Declared {
    double u = 0;
    Shape shape = Shape::normal;
    double dof = std::numeric_limits<double>::infinity();
    bool declared = false;  ///< by somebody, not by default
};

/// One harmonic of the resolvers' error per turn: amplitude known, phase not.
struct Harmonic {
    int order = 1;
    double arcsec = 0;
};

struct Correlation {
    std::string first, second;  ///< keys of inputs, the axis after a dot: "encoder_zero.inner"
    double value = 0;
};

/// Whose motion it is that the encoders see in step with the vibration.
enum class SyncMotionOf : std::uint8_t { warn, platform, base };

/// Type B inputs, in the units of their keys.
struct Inputs {
    Declared latitude_arcsec{10}, azimuth_arcsec{20};
    std::array<Declared, 3> encoder_zero_arcsec{{{10}, {10}, {10}}};
    std::array<Declared, 2> non_orthogonality_arcsec{{{5}, {5}}};  ///< outer-inner, inner-azimuth
    std::vector<Harmonic> resolver_harmonics{{1, 5}, {2, 5}, {16, 3}};
    bool resolver_harmonics_declared = false;
    Declared time_base{1e-5, Shape::rectangular};
    Declared accelerometer_gain{0.005, Shape::rectangular};
    /// Its scatter from one frequency of the vibration to another.
    Declared gain_between_frequencies{0.005};
    std::array<Declared, 3> accelerometer_zero_g{{{1e-4}, {1e-4}, {1e-4}}};
    /// Off-diagonal elements xy, xz, yx, yz, zx, zy, rad.
    std::array<Declared, 6> accelerometer_cross{
        {{2.4e-4}, {2.4e-4}, {2.4e-4}, {2.4e-4}, {2.4e-4}, {2.4e-4}}};
    std::array<Declared, 2> cross_axis{{{0}, {0}}};  ///< north, east: share that Gamma does not see
    Declared local_g{1e-5};
    Declared bias_step_between_runs{0};  ///< deg/h
    SyncMotionOf sync_motion = SyncMotionOf::warn;
    double noise_dof = std::numeric_limits<double>::infinity();
    /// Repeatability from one switch-on to the next, deg/h and deg/h/g.
    std::optional<Declared> turn_on_bias, turn_on_linear;
    /// Of D_F by a ramp of the bias in every dwell, deg/h; none: as the dwells show it.
    std::optional<Declared> ramp_in_dwell;
    std::vector<Correlation> correlations;
    double coverage = 0.95;
};

/// A way in which a rig may differ from the model, with one or more unknowns.
enum class Misfit : std::uint8_t {
    cross_axis,
    azimuth,
    latitude,
    time_base,
    encoder_zero,
    non_orthogonality,
    resolver_1,
    resolver_2,
    resolver_16,
    cubic,
    trend,
    step,
    walk,
    scatter,
    unbalance_trend,
    unbalance_step,
    ramp,
    gyro_noise
};
inline constexpr std::size_t kMisfits = 18;
/// Names of the structural ones, up to the cubic term: as the verdict names them, and as they are
/// freed.
inline constexpr std::array<const char*, 10> kStructuralNames{"cross-axis",
                                                              "azimuth",
                                                              "latitude",
                                                              "time base",
                                                              "encoder zero",
                                                              "non-orthogonality",
                                                              "resolver, once per turn",
                                                              "resolver, twice per turn",
                                                              "resolver, 16 per turn",
                                                              "cubic term"};

enum class BiasModel : std::uint8_t { automatic, constant, walk };
/// Whether the gyros' power was on all the time.
enum class Power : std::uint8_t { unknown, unbroken, per_run };

/// How the bias may move during a campaign.
struct Drift {
    BiasModel model = BiasModel::automatic;
    double walk_deg_h_rt_h = 0.01;
    Power power = Power::unknown;
};

}  // namespace vibrig::estimator::uncertainty
