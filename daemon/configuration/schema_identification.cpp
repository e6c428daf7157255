#include "daemon/configuration/key.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using estimator::Method;
using estimator::SecondMoment;

void add_rig_keys(std::vector<Key>& keys) {
    keys.push_back(number("site.latitude_deg", "deg", {-90, 90}, "latitude of the rig",
                          [](C& c) -> double& { return c.estimator.latitude_deg; }));
    keys.push_back(number("site.azimuth_deg", "deg", {-360, 360},
                          "azimuth of the rig's north axis, from true north towards east",
                          [](C& c) -> double& { return c.estimator.azimuth_deg; }));
    keys.push_back(number("site.elevation_deg", "deg", {-2, 2},
                          "of the rig's north axis (the outer gimbal's, with up +y): the base is "
                          "not level; beyond, shim it",
                          [](C& c) -> double& { return c.estimator.elevation_deg; }));
    keys.push_back(number("site.gravity_mps2", "m/s^2", {9.7, 9.9}, "local gravity, 1 g",
                          [](C& c) -> double& { return c.estimator.gravity_mps2; }));

    keys.push_back(number("vibration.frequency_hz", "Hz", {0.1, 2000},
                          "nominal frequency of the vibration",
                          [](C& c) -> double& { return c.estimator.frequency_hz; }));
    keys.push_back(number("vibration.transmission", "", {0.001, 10},
                          "amplitude on the platform over amplitude at the table",
                          [](C& c) -> double& { return c.estimator.transmission; }));
    keys.push_back(number("vibration.level_window_s", "s", {2, 600},
                          "window of the vibration-level estimate",
                          [](C& c) -> double& { return c.estimator.level_window_s; }));

    keys.push_back(axis(
        "platform.up", "platform axis that points up at zero gimbal angles",
        [](C & c) -> auto& { return c.estimator.up; }));
    keys.push_back(axes(
        "platform.gyro_x_axes", "input, output and spin axis of gyro x",
        [](C & c) -> auto& { return c.estimator.gyro_axes[0]; }));
    keys.push_back(axes(
        "platform.gyro_y_axes", "input, output and spin axis of gyro y",
        [](C & c) -> auto& { return c.estimator.gyro_axes[1]; }));
    keys.push_back(axes(
        "platform.gyro_z_axes", "input, output and spin axis of gyro z",
        [](C & c) -> auto& { return c.estimator.gyro_axes[2]; }));
    keys.push_back(sign("platform.drift_sign",
                        "sign of the platform's rate for a positive drift coefficient",
                        [](C& c) -> int& { return c.estimator.drift_sign; }));
    keys.push_back(choice<SecondMoment>(
        "platform.second_moment",
        {{"measured", SecondMoment::measured}, {"vertical", SecondMoment::vertical}},
        "vibration across the vertical: from all three accelerometers, or taken as none",
        [](C& c) -> SecondMoment& { return c.estimator.second_moment; }));
    keys.push_back(signs(
        "platform.encoder_sign", "outer, inner, azimuth: -1 counts the other way",
        [](C & c) -> auto& { return c.estimator.encoder_sign; }));
    keys.push_back(triple(
        "platform.encoder_zero_deg", "deg", {-360, 360},
        "outer, inner, azimuth: subtracted from the encoder's angle",
        [](C & c) -> auto& { return c.estimator.encoder_zero_deg; }));
}

void add_estimation_keys(std::vector<Key>& keys) {
    keys.push_back(triple(
        "accelerometer.zero_g", "g", {-1, 1}, "subtracted from the raw specific force first",
        [](C & c) -> auto& { return c.estimator.accelerometer_zero_g; }));
    keys.push_back(matrix(
        "accelerometer.matrix", "then applied: raw to platform axes",
        [](C & c) -> auto& { return c.estimator.accelerometer_matrix; }));
    keys.push_back(number("accelerometer.range_g", "g", {0, 1000},
                          "raw readings of this size are saturated; 0: not known",
                          [](C& c) -> double& { return c.estimator.accelerometer_range_g; }));
    add_response_keys(keys);

    keys.push_back(number("noise.resolver_arcsec", "arcsec", {0, 3600},
                          "resolver noise, 1 sigma per sample",
                          [](C& c) -> double& { return c.estimator.resolver_arcsec; }));
    keys.push_back(integer("noise.resolver_bits", "bit", 8, 32, "resolution of one turn",
                           [](C& c) -> int& { return c.estimator.resolver_bits; }));
    keys.push_back(number("noise.gyro_random_walk_deg_per_rt_h", "deg/sqrt(h)", {0, 100},
                          "angle random walk of each gyro", [](C& c) -> double& {
                              return c.estimator.gyro_random_walk_deg_per_rt_h;
                          }));
    keys.push_back(number("noise.accelerometer_g", "g", {0, 1},
                          "accelerometer noise, 1 sigma per sample",
                          [](C& c) -> double& { return c.estimator.accelerometer_g; }));

    keys.push_back(choice<Method>("estimator.method",
                                  {{"joint", Method::joint}, {"two-step", Method::two_step}},
                                  "one filter over all runs, or the route of Tang et al. 2009",
                                  [](C& c) -> Method& { return c.estimator.method; }));
    constexpr Range kPrior{1e-9, 1e6};
    keys.push_back(number("estimator.prior_sigma.bias", "deg/h", kPrior, "of D_F, 1 sigma",
                          [](C& c) -> double& { return c.estimator.prior_bias; }));
    keys.push_back(number("estimator.prior_sigma.linear", "deg/h/g", kPrior,
                          "of D_I, D_O, D_S, 1 sigma",
                          [](C& c) -> double& { return c.estimator.prior_linear; }));
    keys.push_back(number("estimator.prior_sigma.quadratic", "deg/h/g^2", kPrior,
                          "of D_II ... D_OS, 1 sigma",
                          [](C& c) -> double& { return c.estimator.prior_quadratic; }));
    keys.push_back(number("estimator.forgetting", "", {0, 0.9999},
                          "lambda of the amplitude blend (Tang et al. 2009, eq. 18)",
                          [](C& c) -> double& { return c.estimator.forgetting; }));
    keys.push_back(number("estimator.gate_nis", "", {1, 1e9},
                          "three-axis innovation gate, normalised innovation squared",
                          [](C& c) -> double& { return c.estimator.gate_nis; }));
}

}  // namespace

void add_identification_keys(std::vector<Key>& keys) {
    add_rig_keys(keys);
    add_estimation_keys(keys);
}

}  // namespace vibrig::configuration
