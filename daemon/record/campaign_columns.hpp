// The tables of a campaign's file: each column once, with its name, the field of a row that it
// holds, its unit and what it means, in the order of the file. Whoever writes, reads or makes a
// table visits its columns:
//   column(name, field, unit, description): numbers; a field of several is one row of the column,
//   column.newer(...): likewise, where older recordings have none and the field stays as it is,
//   column.by_channel(...): a number for each channel, found by the names that the file gives them;
//     a channel that an older recording lacks is unbound,
//   column.text(name, field, bytes, description).
#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "daemon/domain/events.hpp"
#include "daemon/record/hdf5.hpp"
#include "daemon/record/records.hpp"
#include "drivers/sample/channels.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::record {

/// `Row`, or a constant one.
template <typename T, typename Row>
concept Of = std::same_as<std::remove_const_t<T>, Row>;

/// A line of what was played.
struct PsdLine {
    drivers::Time from = 0;  ///< of its order
    double frequency_hz = 0, psd_g2_hz = 0;
};

/// Names of the channels. Until recordings named them there were these.
inline const hdf5::Names& channel_names() {
    static const hdf5::Names kNames = [] {
        hdf5::Names names{
            {}, {"outer", "inner", "azimuth", "accel_x", "accel_y", "accel_z", "table_accel"}};
        for (const auto& row : drivers::kChannelTable) names.now.emplace_back(row.name);
        return names;
    }();
    return kNames;
}

inline constexpr const char* kTimeText =
    "daemon's clock; UTC is this plus the file's utc_offset_ns";

void columns_of(Of<drivers::Sample> auto& s, auto&& column) {
    column("time_ns", s.time, "ns", kTimeText);
    column("sequence", s.sequence, "", "sync count");
    column("lost_before", s.dropped_before, "", "samples lost on the way to the recorder");
    column("angle_rad", s.angle, "rad", "encoders: outer, inner, azimuth; raw");
    column("force_g", s.force, "g", "specific force, accelerometer axes x, y, z; raw");
    column("table_accel_g", s.table_accel, "g", "accelerometer on the table");
    column.by_channel("quality", std::span(s.quality).template first<drivers::kChannels>(), "",
                      "of each channel, see names: 0 good, 1 missing, 2 stale, 3 flagged, 4 out of "
                      "range, 5 unbound");
}

/// The interlock's as many as the row has: no columns of none.
void columns_of(Of<ConditionRow> auto& c, auto&& column) {
    constexpr const char* kFlag = "1: yes, 0: no, -1: not known then";
    column("time_ns", c.time, "ns", kTimeText);
    column("temperature_c", c.temperature_c, "degC",
           "platform's inner element; NaN: not known then");
    column("sensor_c", c.sensor_c, "degC", "case, gyros x, y, z; NaN: not known then");
    column("command_g", c.command_g, "g", "amplitude that the campaign commands, peak at table");
    column("command_hz", c.command_hz, "Hz", "frequency that the campaign commands");
    column("set_point_g", c.set_point_g, "g", "read back from the shaker, peak at table");
    column("set_point_hz", c.set_point_hz, "Hz", "read back from the shaker");
    column("measured_g", c.measured_g, "g", "measured by the shaker, peak at table");
    column("witness_platform_g", c.witness_platform_g, "g",
           "platform's accelerometers, peak at table");
    column("witness_table_g", c.witness_table_g, "g", "table's accelerometer, peak at table");
    column("shaker_state", c.shaker_state, "",
           "0 idle, 1 ramping, 2 running, 3 stopping, 4 fault, -1 not known then");
    column("shaker_running", c.shaker_running, "", kFlag);
    column("emergency_stop_open", c.emergency_stop_open, "", kFlag);
    column("ready", c.ready, "", kFlag);
    column("loop_closed", c.loop_closed, "", kFlag);
    column("gyros_at_speed", c.gyros_at_speed, "", kFlag);
    column("fault", c.fault, "", kFlag);
    column("in_position", c.in_position, "", kFlag);
    column("slewing", c.slewing, "", kFlag);
    if (c.interlock_value.empty()) return;
    column("interlock_value", c.interlock_value, "see /interlocks",
           "present value of each row of /interlocks; NaN: not watched then");
    column("interlock_raised", c.interlock_raised, "", "1: beyond its limit");
}

void columns_of(Of<Gap> auto& gap, auto&& column) {
    column("from_ns", gap.from, "ns", kTimeText);
    column("to_ns", gap.to, "ns", kTimeText);
    column.text("stream", gap.stream, 16, "what is missing");
    column("lost", gap.lost, "", "how many");
    column.text("reason", gap.reason, 160, "why");
}

void columns_of(Of<Order> auto& o, auto&& column) {
    column("announced_ns", o.announced, "ns", "when it was ordered");
    column("from_ns", o.from, "ns", "samples from this time on belong to the dwell");
    column("to_ns", o.to, "ns", "samples before this time belong to the dwell");
    column("run", o.run, "", "from 1");
    column("position", o.position, "", "from 1");
    column("table_g", o.table_g, "g", "commanded peak at the table");
    column("cancel", o.cancel, "", "1: the dwell in progress ends with what it has");
    column("zero_g", o.zero_g, "g", "taken off the raw specific force: zeros in place");
    column("level_sigma_g", o.level_sigma_g, "g", "of the vertical, by those zeros; 0: none");
    column("noise_angle_arcsec", o.noise.angle_arcsec, "arcsec",
           "noise of a reading, for the filter");
    column("noise_walk", o.noise.gyro_random_walk_deg_per_rt_h, "deg/sqrt(h)",
           "gyros' random walk, for the filter");
    column.newer("begin_s", o.begin_s, "s", "of the dwell, since the campaign's first one");
    column.newer("power_lost", o.power_lost, "", "1: the gyros were without power since the last");
    column.newer("frequency_hz", o.frequency_hz, "Hz", "commanded; 0: the configuration's");
    column.newer("held_out", o.held_out, "", "1: for verification, no part of the fit");
    auto& random = o.random;
    column.newer("profile", random.profile, "",
                 "of random vibration, its number; 0: a sine or rest");
    column.newer("level_db", random.level_db, "dB", "about the profile");
    column.newer("random_mean_square_g2", random.mean_square_g2, "g^2",
                 "as the profile has it, platform");
    column.newer("random_bandwidth_hz", random.bandwidth_hz, "Hz", "(Int S)^2 over Int S^2");
    column.newer("random_gain_error", random.gain_error, "",
                 "of the mean square, relative, 1 sigma");
    column.newer("random_highest_hz", random.highest_hz, "Hz", "up to which there is power");
    column.newer("sweep_from_hz", o.sweep.from_hz, "Hz", "where a sweep begins; 0: it is none");
    column.newer("sweep_to_hz", o.sweep.to_hz, "Hz", "where it ends");
    column.newer("sweep_s", o.sweep.seconds, "s", "from one to the other");
}

void columns_of(Of<SweptRow> auto& row, auto&& column) {
    column("time_ns", row.time, "ns", kTimeText);
    column("run", row.run, "", "from 1");
    column("position", row.position, "", "from 1");
    column("frequency_hz", row.frequency_hz, "Hz", "where the shaker's controller says that it is");
}

void columns_of(Of<Played> auto& played, auto&& column) {
    auto& [word, random, seen, place] = played.random;
    column("from_ns", played.from, "ns", "of the dwell in /orders");
    column("run", played.run, "", "from 1");
    column("position", played.position, "", "from 1");
    column("word", word, "", "0: taken, 1: not read, 2: refused");
    column("mean_square_g2", random.mean_square_g2, "g^2", "by the controller's PSD, platform");
    column("bandwidth_hz", random.bandwidth_hz, "Hz", "(Int S)^2 over Int S^2");
    column("gain_error", random.gain_error, "", "of the mean square, relative, 1 sigma");
    column("highest_hz", random.highest_hz, "Hz", "up to which there is power");
    column("seen_share", seen.share, "", "of its power, by the accelerometers");
    column("seen_error", seen.error, "", "of that, relative, 1 sigma");
}

void columns_of(Of<PsdLine> auto& line, auto&& column) {
    column("from_ns", line.from, "ns", "of the dwell in /orders");
    column("frequency_hz", line.frequency_hz, "Hz", "as the controller says it after the dwell");
    column("psd_g2_hz", line.psd_g2_hz, "g^2/Hz", "likewise, at the table");
}

/// Columns of a dwell whose covariance is there.
void columns_of(Of<Dwell> auto& dwell, auto&& column) {
    auto& s = dwell.summary;
    column("time_ns", dwell.time, "ns", kTimeText);
    column("run", s.run, "", "from 1");
    column("position", s.position, "", "from 1");
    column("samples", s.samples, "", "offered to the filter");
    column("used", s.used, "", "of them in the filter");
    column("rejected", s.rejected, "", "of them not in the filter");
    column("reinitialised", s.reinitialised, "", "times the angles started afresh");
    column("kappa", s.kappa, "", "1 + a^2 / 2 over the whole dwell");
    column("amplitude_g", s.amplitude_g, "g", "peak at the platform");
    column("frequency_hz", s.frequency_hz, "Hz", "of the vibration; 0 at rest");
    column("mean_force_g", s.mean_force_g, "g", "vertical specific force, mean");
    column("nis_per_dof", s.nis_per_dof, "", "normalised innovations squared, 1 expected");
    column("innovation_correlation", s.innovation_correlation, "", "from one sample to the next");
    column("flagged", s.flagged, "", "1: see reason");
    column.text("reason", dwell.reason, 96, "why it is flagged");
    column("value", dwell.value, "deg/h, deg/h/g, deg/h/g^2", "coefficients after the dwell");
    column("sigma", dwell.sigma, "deg/h, deg/h/g, deg/h/g^2", "their standard deviations");
    column("observable", dwell.observable, "", "1: determined by the data");
    column("covariance", dwell.covariance, "products of the units", "of the coefficients",
           {estimator::kParameters, estimator::kParameters});
}

/// Behind those of its dwell.
void columns_of(Of<DwellNumbers> auto& of, auto&& column) {
    column("middle_s", of.middle_s, "s", "since the campaign began; NaN: it is left out");
    column("rate", of.rate, "deg/h", "mean drift of gyros x, y, z, Earth rate taken out");
    column("rate_covariance", of.rate_covariance, "(deg/h)^2", "of noise", {3, 3});
    column("rate_regressors", of.rate_regressors, "1, g, g^2",
           "rate is their product with a gyro's ten coefficients: F, I, O, S, II, OO, SS, IO, IS, "
           "OS",
           {3, estimator::kParameters / 3});
    column("ramp", of.ramp, "deg/h per 100 s", "of the drift along the dwell");
    column("ramp_sigma", of.ramp_sigma, "deg/h per 100 s", "of noise");
    column("gamma", of.gamma, "", "second moment NN, UU, EE, NU, NE, UE over UU");
    column("sync_arcsec", of.sync_arcsec, "arcsec", "of the angles in step with the vibration");
}

void columns_of(Of<EstimateRow> auto& row, auto&& column) {
    column("time_ns", row.time, "ns", kTimeText);
    column("amplitude_g", row.amplitude_g, "g", "peak at the platform, present dwell");
    column("frequency_hz", row.frequency_hz, "Hz", "of the vibration");
    column("kappa", row.kappa, "", "1 + a^2 / 2");
    column("nis_per_dof", row.nis_per_dof, "", "normalised innovations squared so far");
    column("innovation_arcsec", row.innovation_arcsec, "arcsec", "outer, inner, azimuth");
    column("value", row.value, "deg/h, deg/h/g, deg/h/g^2", "coefficients");
    column("sigma", row.sigma, "deg/h, deg/h/g, deg/h/g^2", "standard deviations");
}

void columns_of(Of<EventRecord> auto& event, auto&& column) {
    column("time_ns", event.time, "ns", kTimeText);
    column("utc_ns", event.utc_ns, "ns", "UTC since 1970");
    column.text("severity", event.severity, 8, "info, warning, alarm or trip");
    column.text("source", event.source, 16, "who says so");
    column.text("text", event.text, 320, "what happened");
}

/// Attributes of a part's file: attribute(name, field).
void attributes_of(Of<Head> auto& head, auto&& attribute) {
    attribute("name", head.name);
    attribute("started_by", head.started_by);
    attribute("started_utc_ns", head.utc_ns);
    attribute("utc_offset_ns", head.utc_offset_ns);
    attribute("clock", head.clock);
    attribute("simulated", head.simulated);
    attribute("version", head.version);
    attribute("compiler", head.compiler);
    attribute("instruction_set", head.instruction_set);
    attribute("configuration_hash", head.configuration_hash);
    attribute("campaign", head.campaign);
    attribute("part", head.part);
    attribute("restart", head.restart);
    attribute("dwells_before", head.dwells_before);
}

/// A field's numbers: its own, or those of an array.
template <typename T>
auto numbers_in(T& field) {
    if constexpr (requires { field.data(); }) {
        return std::span(field.data(), field.size());
    } else {
        return std::span(&field, 1);
    }
}

/// A number of type T as it stands in the file.
template <typename T>
using Stored = std::conditional_t<
    std::is_enum_v<T> || std::same_as<T, bool>, std::uint8_t,
    std::conditional_t<std::same_as<T, std::int8_t> || std::same_as<T, std::uint16_t>, std::int32_t,
                       T>>;

template <typename T>
constexpr hdf5::Type type_of() {
    using enum hdf5::Type;
    if (std::same_as<Stored<T>, double>) return f64;
    if (std::same_as<Stored<T>, std::uint8_t>) return u8;
    if (sizeof(Stored<T>) == 8) return std::is_signed_v<T> ? i64 : u64;
    return std::same_as<Stored<T>, std::uint32_t> ? u32 : i32;
}

/// A visitor: for a table that is made, or opened to be written.
struct Specify {
    std::vector<hdf5::ColumnSpec>& specs;

    void operator()(const char* name, const auto& field, const char* unit, const char* description,
                    std::vector<std::size_t> shape = {}) {
        const auto numbers = numbers_in(field);
        if constexpr (requires { field.data(); })
            if (shape.empty()) shape = {numbers.size()};
        specs.push_back({name, type_of<typename decltype(numbers)::value_type>(), 0,
                         std::move(shape), unit, description});
    }
    void newer(const auto&... column) {
        (*this)(column...);
        specs.back().newer = true;
    }
    void by_channel(const auto&... column) {
        (*this)(column...);
        specs.back().names = &channel_names();
    }
    void text(const char* name, const auto&, std::size_t bytes, const char* description) {
        specs.push_back({name, hdf5::Type::text, bytes, {}, "", description});
    }
};

/// The columns of rows such as `like`.
template <typename... Row>
std::vector<hdf5::ColumnSpec> specs_of(const Row&... like) {
    std::vector<hdf5::ColumnSpec> specs;
    (columns_of(like, Specify{specs}), ...);
    return specs;
}

/// A visitor: cells of one row.
struct Put {
    hdf5::Table& table;

    void operator()(const char*, const auto& field, const char*, const char*,
                    std::initializer_list<std::size_t> = {}) {
        const auto numbers = numbers_in(field);
        using T = typename decltype(numbers)::value_type;
        if constexpr (sizeof(T) == sizeof(Stored<T>)) {
            table.put(numbers.data(), numbers.size_bytes());
        } else {
            const Stored<T> number = field;
            table.put(&number, sizeof number);
        }
    }
    void newer(const auto&... column) { (*this)(column...); }
    void by_channel(const auto&... column) { (*this)(column...); }
    void text(const char*, const std::string& text, const auto&...) { table.put(text); }
    void text(const char*, Severity severity, const auto&...) { table.put(name_of(severity)); }
};

template <typename... Row>
void put_row(hdf5::Table& table, const Row&... row) {
    (columns_of(row, Put{table}), ...);
}

}  // namespace vibrig::record
