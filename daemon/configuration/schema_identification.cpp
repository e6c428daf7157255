#include "daemon/configuration/key.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using E = estimator::Settings;
using estimator::Method;
using estimator::SecondMoment;

std::vector<Key> rig_keys() {
    const auto rig = part(&C::estimator);
    const auto gyro = [](std::size_t i) {
        return [i](C & c) -> auto& { return c.estimator.gyro_axes[i]; };
    };
    return {
        number("site.latitude_deg", rig(&E::latitude_deg), "deg", {-90, 90}, "latitude of the rig"),
        number("site.azimuth_deg", rig(&E::azimuth_deg), "deg", {-360, 360},
               "azimuth of the rig's north axis, from true north towards east"),
        number("site.elevation_deg", rig(&E::elevation_deg), "deg", {-2, 2},
               "of the rig's north axis (the outer gimbal's, with up +y): the base is not level; "
               "beyond, shim it"),
        number("site.gravity_mps2", rig(&E::gravity_mps2), "m/s^2", {9.7, 9.9},
               "local gravity, 1 g"),

        number("vibration.frequency_hz", rig(&E::frequency_hz), "Hz", {0.1, 2000},
               "nominal frequency of the vibration"),
        number("vibration.transmission", rig(&E::transmission), "", {0.001, 10},
               "amplitude on the platform over amplitude at the table"),
        number("vibration.level_window_s", rig(&E::level_window_s), "s", {2, 600},
               "window of the vibration-level estimate"),

        axis("platform.up", rig(&E::up), "platform axis that points up at zero gimbal angles"),
        axes("platform.gyro_x_axes", gyro(0), "input, output and spin axis of gyro x"),
        axes("platform.gyro_y_axes", gyro(1), "input, output and spin axis of gyro y"),
        axes("platform.gyro_z_axes", gyro(2), "input, output and spin axis of gyro z"),
        sign("platform.drift_sign", rig(&E::drift_sign),
             "sign of the platform's rate for a positive drift coefficient"),
        choice<SecondMoment>(
            "platform.second_moment", rig(&E::second_moment),
            {{"measured", SecondMoment::measured}, {"vertical", SecondMoment::vertical}},
            "vibration across the vertical: from all three accelerometers, or taken as none"),
        signs("platform.encoder_sign", rig(&E::encoder_sign),
              "outer, inner, azimuth: -1 counts the other way"),
        triple("platform.encoder_zero_deg", rig(&E::encoder_zero_deg), "deg", {-360, 360},
               "outer, inner, azimuth: subtracted from the encoder's angle"),
    };
}

std::vector<Key> accelerometer_keys() {
    const auto rig = part(&C::estimator);
    return {
        triple("accelerometer.zero_g", rig(&E::accelerometer_zero_g), "g", {-1, 1},
               "subtracted from the raw specific force first"),
        matrix("accelerometer.matrix", rig(&E::accelerometer_matrix),
               "then applied: raw to platform axes"),
        number("accelerometer.range_g", rig(&E::accelerometer_range_g), "g", {0, 1000},
               "raw readings of this size are saturated; 0: not known"),
    };
}

std::vector<Key> estimation_keys() {
    const auto rig = part(&C::estimator);
    constexpr Range kPrior{1e-9, 1e6};
    return {
        number("noise.resolver_arcsec", rig(&E::resolver_arcsec), "arcsec", {1e-6, 3600},
               "resolver noise, 1 sigma per sample"),
        integer("noise.resolver_bits", rig(&E::resolver_bits), "bit", 8, 32,
                "resolution of one turn"),
        number("noise.gyro_random_walk_deg_per_rt_h", rig(&E::gyro_random_walk_deg_per_rt_h),
               "deg/sqrt(h)", {0, 100}, "angle random walk of each gyro"),
        number("noise.accelerometer_g", rig(&E::accelerometer_g), "g", {0, 1},
               "accelerometer noise, 1 sigma per sample"),

        choice<Method>("estimator.method", rig(&E::method),
                       {{"joint", Method::joint}, {"two-step", Method::two_step}},
                       "one filter over all runs, or the route of Tang et al. 2009"),
        number("estimator.prior_sigma.bias", rig(&E::prior_bias), "deg/h", kPrior,
               "of D_F, 1 sigma"),
        number("estimator.prior_sigma.linear", rig(&E::prior_linear), "deg/h/g", kPrior,
               "of D_I, D_O, D_S, 1 sigma"),
        number("estimator.prior_sigma.quadratic", rig(&E::prior_quadratic), "deg/h/g^2", kPrior,
               "of D_II ... D_OS, 1 sigma"),
        number("estimator.forgetting", rig(&E::forgetting), "", {0, 0.9999},
               "lambda of the amplitude blend (Tang et al. 2009, eq. 18)"),
        number("estimator.gate_nis", rig(&E::gate_nis), "", {1, 1e9},
               "three-axis innovation gate, normalised innovation squared"),
    };
}

}  // namespace

std::vector<Key> identification_keys() {
    return joined({rig_keys(), accelerometer_keys(), response_keys(), estimation_keys()});
}

}  // namespace vibrig::configuration
