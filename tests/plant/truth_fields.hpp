#pragma once

#include "tests/plant/truth.hpp"

namespace vibrig::plant {

// The one list of keys, walked by the reader and by the writer. T is Truth or const Truth.
template <class T, class Field>
void for_each_field(T& t, Field&& field) {
    field("site", "latitude_deg", t.latitude_deg, -89.0, 89.0);
    field("site", "azimuth_deg", t.azimuth_deg, -360.0, 360.0);
    field("site", "gravity_mps2", t.gravity_mps2, 1.0, 30.0);
    field("site", "time_base", t.time_base, -0.1, 0.1);
    field("site", "base_tilt_deg", t.base_tilt_deg, -10.0, 10.0);
    field("platform", "up", t.up, 0, 0);
    field("platform", "gyro_x_axes", t.gyro_axes[0], 0, 0);
    field("platform", "gyro_y_axes", t.gyro_axes[1], 0, 0);
    field("platform", "gyro_z_axes", t.gyro_axes[2], 0, 0);
    field("platform", "drift_sign", t.drift_sign, -1, 1);
    field("platform", "encoder_sign", t.encoder_sign, -1, 1);
    field("platform", "encoder_zero_deg", t.encoder_zero_deg, -360.0, 360.0);
    field("platform", "channel", t.channel, 0, 0);
    field("platform", "angle_unit", t.angle_unit, 0, 0);
    field("platform", "command_channel", t.command_channel, 0, 0);
    field("platform", "command_offset_deg", t.command_offset_deg, -180.0, 180.0);
    field("platform", "stuck_gimbal", t.stuck_gimbal, 0, 0);
    field("platform", "soft_stop_deg", t.soft_stop_deg, 1.0, 360.0);
    field("platform", "slew_deg_per_s", t.slew_deg_per_s, 0.01, 360.0);
    field("platform", "slew_error_deg", t.slew_error_deg, 0.0, 5.0);
    field("platform", "torquer_scale", t.torquer_scale, -100.0, 100.0);
    field("platform", "increment_sign", t.increment_sign, -1, 1);
    field("platform", "sample_rate_hz", t.sample_rate_hz, 1.0, 10'000.0);
    field("platform", "non_orthogonality_arcsec", t.non_orthogonality_arcsec, -36e3, 36e3);
    field("platform", "rocking_arcsec_g", t.platform_rocking_arcsec_g, -1e3, 1e3);
    field("platform", "rocking_quadrature_arcsec_g", t.platform_rocking_quadrature_arcsec_g, -1e3,
          1e3);
    field("platform", "warm_up_s", t.warm_up_s, 0.0, 1e6);
    field("platform", "start_temperature_c", t.start_temperature_c, -60.0, 150.0);
    field("platform", "steady_temperature_c", t.steady_temperature_c, -60.0, 150.0);
    field("platform", "thermal_time_constant_s", t.thermal_time_constant_s, 1e-3, 1e6);
    field("accelerometer", "zero_g", t.zero_g, -1.0, 1.0);
    field("accelerometer", "matrix", t.matrix, -2.0, 2.0);
    field("accelerometer", "dead", t.dead, 0, 0);
    field("accelerometer", "vibration_gain", t.vibration_gain, 0.0, 10.0);
    field("accelerometer", "latency_s", t.latency_s, 0.0, 0.025);
    field("accelerometer", "bandwidth_hz", t.accelerometer_bandwidth_hz, 0.0, 1e5);
    field("accelerometer", "order", t.accelerometer_order, 1, 8);
    field("accelerometer", "skew_ms", t.accelerometer_skew_ms, 0.0, 25.0);
    field("resolver", "harmonic_1_arcsec", t.harmonic_1_arcsec, -36e3, 36e3);
    field("resolver", "harmonic_1_phase_deg", t.harmonic_1_phase_deg, -360.0, 360.0);
    field("resolver", "harmonic_2_arcsec", t.harmonic_2_arcsec, -36e3, 36e3);
    field("resolver", "harmonic_2_phase_deg", t.harmonic_2_phase_deg, -360.0, 360.0);
    field("resolver", "harmonic_16_arcsec", t.harmonic_16_arcsec, -36e3, 36e3);
    field("resolver", "harmonic_16_phase_deg", t.harmonic_16_phase_deg, -360.0, 360.0);
    field("drift", "bias_step_deg_h", t.bias_step_deg_h, -1e3, 1e3);
    field("drift", "unbalance_step_deg_h_g", t.unbalance_step_deg_h_g, -1e3, 1e3);
    field("drift", "step_at_s", t.step_at_s, 0.0, 1e9);
    field("drift", "step_after_dwell", t.step_after_dwell, 0, 1'000'000);
    field("drift", "bias_ramp_deg_h_h", t.bias_ramp_deg_h_h, -1e3, 1e3);
    field("drift", "unbalance_ramp_deg_h_g_h", t.unbalance_ramp_deg_h_g_h, -1e3, 1e3);
    field("drift", "bias_ramp_in_dwell_deg_h", t.bias_ramp_in_dwell_deg_h, -1e3, 1e3);
    field("drift", "bias_walk_deg_h_rt_h", t.bias_walk_deg_h_rt_h, 0.0, 1e3);
    field("drift", "bias_scatter_deg_h", t.bias_scatter_deg_h, 0.0, 1e3);
    field("drift", "bias_markov_deg_h", t.bias_markov_deg_h, 0.0, 1e3);
    field("drift", "bias_markov_s", t.bias_markov_s, 1e-3, 1e9);
    field("drift", "cubic_deg_h_g3", t.cubic_deg_h_g3, -1e3, 1e3);
    field("noise", "resolver_arcsec", t.resolver_arcsec, 0.0, 1e5);
    field("noise", "resolver_bits", t.resolver_bits, 8, 24);
    field("noise", "gyro_random_walk_deg_per_rt_h", t.gyro_random_walk_deg_per_rt_h, 0.0, 10.0);
    field("noise", "accelerometer_g", t.accelerometer_g, 0.0, 1.0);
    field("noise", "table_accelerometer_g", t.table_accelerometer_g, 0.0, 1.0);
    field("isolator", "transmission", t.transmission, 0.05, 2.0);
    field("isolator", "frequency_hz", t.frequency_hz, 0.5, 200.0);
    field("isolator", "damping", t.damping, 0.01, 0.95);
    field("isolator", "slew_kick_g", t.slew_kick_g, 0.0, 1.0);
    field("isolator", "cross_axis", t.cross_axis, -1.0, 1.0);
    field("isolator", "cross_axis_quadrature", t.cross_axis_quadrature, -1.0, 1.0);
    field("isolator", "base_rocking_arcsec_g", t.base_rocking_arcsec_g, -1e3, 1e3);
    field("isolator", "base_rocking_quadrature_arcsec_g", t.base_rocking_quadrature_arcsec_g, -1e3,
          1e3);
    field("isolator", "hard", t.hard, 0, 0);
    field("elastic", "share", t.elastic_share, -2.0, 2.0);
    field("elastic", "resonance_hz", t.elastic_resonance_hz, 5.0, 2000.0);
    field("elastic", "damping", t.elastic_damping, 1e-3, 1.0);
    field("shaker", "second_harmonic", t.second_harmonic, 0.0, 0.5);
    field("shaker", "third_harmonic", t.third_harmonic, 0.0, 0.5);
    field("shaker", "fourth_harmonic", t.fourth_harmonic, 0.0, 0.5);
    field("shaker", "fifth_harmonic", t.fifth_harmonic, 0.0, 0.5);
    field("shaker", "tilt_deg", t.tilt_deg, -45.0, 45.0);
    field("shaker", "amplitude_drift_per_h", t.amplitude_drift_per_h, -100.0, 100.0);
    field("shaker", "frequency_drift_hz_per_h", t.frequency_drift_hz_per_h, -1e3, 1e3);
    field("shaker", "map", t.map, 0, 0);
    field("shaker", "limit_g", t.limit_g, 0.1, 100.0);
    field("shaker", "limit_mm", t.limit_mm, 0.1, 1000.0);
    field("shaker", "watchdog_works", t.watchdog_works, 0, 0);
    field("shaker", "amplitude_unit", t.amplitude_unit, 0, 0);
    field("shaker", "ack_without_stop", t.shaker_lies.ack_without_stop, 0, 0);
    field("shaker", "timeout_ignored", t.shaker_lies.timeout_ignored, 0, 0);
    field("shaker", "timeout_scaled", t.shaker_lies.timeout_scaled, 0.0, 1000.0);
    field("shaker", "timeout_if_linked", t.shaker_lies.timeout_if_linked, 0, 0);
    field("shaker", "timeout_if_unlinked", t.shaker_lies.timeout_if_unlinked, 0, 0);
    field("shaker", "estop_contact_only", t.shaker_lies.estop_contact_only, 0, 0);
    field("shaker", "estop_unseen", t.shaker_lies.estop_unseen, 0, 0);
    field("shaker", "estop_restarts", t.shaker_lies.estop_restarts, 0, 0);
    field("shaker", "amplitude_scaled", t.shaker_lies.amplitude_scaled, 0.0, 1000.0);
    field("shaker", "readback_echo", t.shaker_lies.readback_echo, 0, 0);
    field("shaker", "stuck_contactor", t.shaker_lies.stuck_contactor, 0, 0);
    field("shaker", "slow_ramp", t.shaker_lies.slow_ramp, 1.0, 1000.0);
    field("shaker", "unit_rms", t.shaker_lies.unit_rms, 0, 0);
    field("shaker", "unit_mps2", t.shaker_lies.unit_mps2, 0, 0);
    field("shaker", "dead_table", t.shaker_lies.dead_table, 0, 0);
    field("shaker", "frequency_ignored", t.shaker_lies.frequency_ignored, 0, 0);
    field("shaker", "wrong_profile", t.shaker_lies.wrong_profile, 0, 65535);
    field("shaker", "profile_level_wrong", t.shaker_lies.profile_level_wrong, -60.0, 20.0);
    field("shaker", "profile_tilted", t.shaker_lies.profile_tilted, -20.0, 20.0);
    field("shaker", "psd_stale", t.shaker_lies.psd_stale, 0, 0);
    field("shaker", "psd_nan", t.shaker_lies.psd_nan, 0, 0);
    field("shaker", "psd_scaled", t.shaker_lies.psd_scaled, 0.0, 1000.0);
    field("shaker", "psd_refused", t.shaker_lies.psd_refused, 0, 0);
    field("shaker", "no_abort_bands", t.shaker_lies.no_abort_bands, 0, 0);
    field("shaker", "sweep_rate_scaled", t.shaker_lies.sweep_rate_scaled, -20.0, 20.0);
    field("shaker", "actual_as_told", t.shaker_lies.actual_as_told, 0, 0);
    field("shaker", "timeout_register", t.shaker_lies.timeout_register, 0, 65535);
    field("shaker", "latched_fault", t.shaker_lies.latched_fault, 0, 0);
}

}  // namespace vibrig::plant
