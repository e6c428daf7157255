#include "daemon/record/campaign_columns.hpp"

#include "drivers/sample/sample.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::record {

using estimator::kParameters;
using hdf5::ColumnSpec;
using hdf5::Type;

namespace {

const char* const kRegressorText =
    "rate is their product with a gyro's ten coefficients: F, I, O, S, II, OO, SS, IO, IS, OS";
const char* const kTimeText = "daemon's clock; UTC is this plus the file's utc_offset_ns";

}  // namespace

std::vector<ColumnSpec> sample_columns() {
    return {{"time_ns", Type::i64, {}, "ns", kTimeText},
            {"sequence", Type::u32, {}, "", "sync count"},
            {"lost_before", Type::u32, {}, "", "samples lost on the way to the recorder"},
            {"angle_rad", Type::f64, {3}, "rad", "encoders: outer, inner, azimuth; raw"},
            {"force_g", Type::f64, {3}, "g", "specific force, accelerometer axes x, y, z; raw"},
            {"table_accel_g", Type::f64, {}, "g", "accelerometer on the table"},
            {"quality",
             Type::u8,
             {drivers::kChannels},
             "",
             "of outer, inner, azimuth, accelerometers x, y, z, table: 0 good, 1 missing, 2 stale, "
             "3 flagged, 4 out of range, 5 unbound"}};
}

std::vector<ColumnSpec> condition_columns(std::size_t rows) {
    const char* const flag = "1: yes, 0: no, -1: not known then";
    std::vector<ColumnSpec> columns{
        {"time_ns", Type::i64, {}, "ns", kTimeText},
        {"temperature_c", Type::f64, {}, "degC", "platform's inner element; NaN: not known then"},
        {"sensor_c",
         Type::f64,
         {drivers::kTemperatureSensors.size()},
         "degC",
         "case, gyros x, y, z; NaN: not known then"},
        {"command_g", Type::f64, {}, "g", "amplitude that the campaign commands, peak at table"},
        {"command_hz", Type::f64, {}, "Hz", "frequency that the campaign commands"},
        {"set_point_g", Type::f64, {}, "g", "read back from the shaker, peak at table"},
        {"set_point_hz", Type::f64, {}, "Hz", "read back from the shaker"},
        {"measured_g", Type::f64, {}, "g", "measured by the shaker, peak at table"},
        {"witness_platform_g", Type::f64, {}, "g", "platform's accelerometers, peak at table"},
        {"witness_table_g", Type::f64, {}, "g", "table's accelerometer, peak at table"},
        {"shaker_state",
         Type::i32,
         {},
         "",
         "0 idle, 1 ramping, 2 running, 3 stopping, 4 fault, -1 not known then"},
        {"shaker_running", Type::i32, {}, "", flag},
        {"emergency_stop_open", Type::i32, {}, "", flag}};
    for (const char* name :
         {"ready", "loop_closed", "gyros_at_speed", "fault", "in_position", "slewing"})
        columns.push_back({name, Type::i32, {}, "", flag});
    if (rows == 0) return columns;
    columns.push_back({"interlock_value",
                       Type::f64,
                       {rows},
                       "see /interlocks",
                       "present value of each row of /interlocks; NaN: not watched then"});
    columns.push_back({"interlock_raised", Type::u8, {rows}, "", "1: beyond its limit"});
    return columns;
}

std::vector<ColumnSpec> gap_columns() {
    return {{"from_ns", Type::i64, {}, "ns", kTimeText},
            {"to_ns", Type::i64, {}, "ns", kTimeText},
            {"stream", Type::text, {16}, "", "what is missing"},
            {"lost", Type::u64, {}, "", "how many"},
            {"reason", Type::text, {160}, "", "why"}};
}

std::vector<ColumnSpec> order_columns() {
    return {{"announced_ns", Type::i64, {}, "ns", "when it was ordered"},
            {"from_ns", Type::i64, {}, "ns", "samples from this time on belong to the dwell"},
            {"to_ns", Type::i64, {}, "ns", "samples before this time belong to the dwell"},
            {"run", Type::i32, {}, "", "from 1"},
            {"position", Type::i32, {}, "", "from 1"},
            {"table_g", Type::f64, {}, "g", "commanded peak at the table"},
            {"cancel", Type::u8, {}, "", "1: the dwell in progress ends with what it has"},
            {"zero_g", Type::f64, {3}, "g", "taken off the raw specific force: zeros in place"},
            {"level_sigma_g", Type::f64, {}, "g", "of the vertical, by those zeros; 0: none"},
            {"noise_angle_arcsec", Type::f64, {}, "arcsec", "noise of a reading, for the filter"},
            {"noise_walk", Type::f64, {3}, "deg/sqrt(h)", "gyros' random walk, for the filter"},
            {"begin_s", Type::f64, {}, "s", "of the dwell, since the campaign's first one"},
            {"power_lost", Type::u8, {}, "", "1: the gyros were without power since the last"},
            {"frequency_hz", Type::f64, {}, "Hz", "commanded; 0: the configuration's"},
            {"held_out", Type::u8, {}, "", "1: for verification, no part of the fit"},
            {"profile", Type::i32, {}, "", "of random vibration, its number; 0: a sine or rest"},
            {"level_db", Type::f64, {}, "dB", "about the profile"},
            {"random_mean_square_g2", Type::f64, {}, "g^2", "as the profile has it, platform"},
            {"random_bandwidth_hz", Type::f64, {}, "Hz", "(Int S)^2 over Int S^2"},
            {"random_gain_error", Type::f64, {}, "", "of the mean square, relative, 1 sigma"},
            {"random_highest_hz", Type::f64, {}, "Hz", "up to which there is power"},
            {"sweep_from_hz", Type::f64, {}, "Hz", "where a sweep begins; 0: it is none"},
            {"sweep_to_hz", Type::f64, {}, "Hz", "where it ends"},
            {"sweep_s", Type::f64, {}, "s", "from one to the other"}};
}

std::vector<ColumnSpec> swept_columns() {
    return {{"time_ns", Type::i64, {}, "ns", kTimeText},
            {"run", Type::i32, {}, "", "from 1"},
            {"position", Type::i32, {}, "", "from 1"},
            {"frequency_hz", Type::f64, {}, "Hz", "where the shaker's controller says that it is"}};
}

std::vector<ColumnSpec> played_columns() {
    return {{"from_ns", Type::i64, {}, "ns", "of the dwell in /orders"},
            {"run", Type::i32, {}, "", "from 1"},
            {"position", Type::i32, {}, "", "from 1"},
            {"word", Type::u8, {}, "", "0: taken, 1: not read, 2: refused"},
            {"mean_square_g2", Type::f64, {}, "g^2", "by the controller's PSD, platform"},
            {"bandwidth_hz", Type::f64, {}, "Hz", "(Int S)^2 over Int S^2"},
            {"gain_error", Type::f64, {}, "", "of the mean square, relative, 1 sigma"},
            {"highest_hz", Type::f64, {}, "Hz", "up to which there is power"},
            {"seen_share", Type::f64, {}, "", "of its power, by the accelerometers"},
            {"seen_error", Type::f64, {}, "", "of that, relative, 1 sigma"}};
}

std::vector<ColumnSpec> psd_columns() {
    return {{"from_ns", Type::i64, {}, "ns", "of the dwell in /orders"},
            {"frequency_hz", Type::f64, {}, "Hz", "as the controller says it after the dwell"},
            {"psd_g2_hz", Type::f64, {}, "g^2/Hz", "likewise, at the table"}};
}

std::vector<ColumnSpec> dwell_columns() {
    return {{"time_ns", Type::i64, {}, "ns", kTimeText},
            {"run", Type::i32, {}, "", "from 1"},
            {"position", Type::i32, {}, "", "from 1"},
            {"samples", Type::u32, {}, "", "offered to the filter"},
            {"used", Type::u32, {}, "", "of them in the filter"},
            {"rejected", Type::u32, {}, "", "of them not in the filter"},
            {"reinitialised", Type::u32, {}, "", "times the angles started afresh"},
            {"kappa", Type::f64, {}, "", "1 + a^2 / 2 over the whole dwell"},
            {"amplitude_g", Type::f64, {}, "g", "peak at the platform"},
            {"frequency_hz", Type::f64, {}, "Hz", "of the vibration; 0 at rest"},
            {"mean_force_g", Type::f64, {}, "g", "vertical specific force, mean"},
            {"nis_per_dof", Type::f64, {}, "", "normalised innovations squared, 1 expected"},
            {"innovation_correlation", Type::f64, {}, "", "from one sample to the next"},
            {"flagged", Type::u8, {}, "", "1: see reason"},
            {"reason", Type::text, {96}, "", "why it is flagged"},
            {"value",
             Type::f64,
             {kParameters},
             "deg/h, deg/h/g, deg/h/g^2",
             "coefficients after the dwell"},
            {"sigma",
             Type::f64,
             {kParameters},
             "deg/h, deg/h/g, deg/h/g^2",
             "their standard deviations"},
            {"observable", Type::u8, {kParameters}, "", "1: determined by the data"},
            {"covariance",
             Type::f64,
             {kParameters, kParameters},
             "products of the units",
             "of the coefficients"},
            {"middle_s", Type::f64, {}, "s", "since the campaign began; NaN: it is left out"},
            {"rate", Type::f64, {3}, "deg/h", "mean drift of gyros x, y, z, Earth rate taken out"},
            {"rate_covariance", Type::f64, {3, 3}, "(deg/h)^2", "of noise"},
            {"rate_regressors", Type::f64, {3, kParameters / 3}, "1, g, g^2", kRegressorText},
            {"ramp", Type::f64, {3}, "deg/h per 100 s", "of the drift along the dwell"},
            {"ramp_sigma", Type::f64, {3}, "deg/h per 100 s", "of noise"},
            {"gamma", Type::f64, {6}, "", "second moment NN, UU, EE, NU, NE, UE over UU"},
            {"sync_arcsec", Type::f64, {}, "arcsec", "of the angles in step with the vibration"}};
}

std::vector<ColumnSpec> estimate_columns() {
    return {
        {"time_ns", Type::i64, {}, "ns", kTimeText},
        {"amplitude_g", Type::f64, {}, "g", "peak at the platform, present dwell"},
        {"frequency_hz", Type::f64, {}, "Hz", "of the vibration"},
        {"kappa", Type::f64, {}, "", "1 + a^2 / 2"},
        {"nis_per_dof", Type::f64, {}, "", "normalised innovations squared so far"},
        {"innovation_arcsec", Type::f64, {3}, "arcsec", "outer, inner, azimuth"},
        {"value", Type::f64, {kParameters}, "deg/h, deg/h/g, deg/h/g^2", "coefficients"},
        {"sigma", Type::f64, {kParameters}, "deg/h, deg/h/g, deg/h/g^2", "standard deviations"}};
}

std::vector<ColumnSpec> event_columns() {
    return {{"time_ns", Type::i64, {}, "ns", kTimeText},
            {"utc_ns", Type::i64, {}, "ns", "UTC since 1970"},
            {"severity", Type::text, {8}, "", "info, warning, alarm or trip"},
            {"source", Type::text, {16}, "", "who says so"},
            {"text", Type::text, {320}, "", "what happened"}};
}

}  // namespace vibrig::record
