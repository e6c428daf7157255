#include "daemon/record/campaign_writer.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "estimator/filter/parameters.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::record {

using hdf5::ColumnSpec;
using hdf5::File;
using hdf5::Table;
using hdf5::Type;

namespace {

constexpr std::size_t kN = estimator::kParameters;
constexpr std::size_t kTerms = kN / 3;
const char* const kRegressorText =
    "rate is their product with a gyro's ten coefficients: F, I, O, S, II, OO, SS, IO, IS, OS";
const char* const kTimeText = "daemon's clock; UTC is this plus the file's utc_offset_ns";

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
            {"value", Type::f64, {kN}, "deg/h, deg/h/g, deg/h/g^2", "coefficients after the dwell"},
            {"sigma", Type::f64, {kN}, "deg/h, deg/h/g, deg/h/g^2", "their standard deviations"},
            {"observable", Type::u8, {kN}, "", "1: determined by the data"},
            {"covariance", Type::f64, {kN, kN}, "products of the units", "of the coefficients"},
            {"middle_s", Type::f64, {}, "s", "since the campaign began; NaN: it is left out"},
            {"rate", Type::f64, {3}, "deg/h", "mean drift of gyros x, y, z, Earth rate taken out"},
            {"rate_covariance", Type::f64, {3, 3}, "(deg/h)^2", "of noise"},
            {"rate_regressors", Type::f64, {3, kTerms}, "1, g, g^2", kRegressorText},
            {"ramp", Type::f64, {3}, "deg/h per 100 s", "of the drift along the dwell"},
            {"ramp_sigma", Type::f64, {3}, "deg/h per 100 s", "of noise"},
            {"gamma", Type::f64, {6}, "", "second moment NN, UU, EE, NU, NE, UE over UU"},
            {"sync_arcsec", Type::f64, {}, "arcsec", "of the angles in step with the vibration"}};
}

std::vector<ColumnSpec> estimate_columns() {
    return {{"time_ns", Type::i64, {}, "ns", kTimeText},
            {"amplitude_g", Type::f64, {}, "g", "peak at the platform, present dwell"},
            {"frequency_hz", Type::f64, {}, "Hz", "of the vibration"},
            {"kappa", Type::f64, {}, "", "1 + a^2 / 2"},
            {"nis_per_dof", Type::f64, {}, "", "normalised innovations squared so far"},
            {"innovation_arcsec", Type::f64, {3}, "arcsec", "outer, inner, azimuth"},
            {"value", Type::f64, {kN}, "deg/h, deg/h/g, deg/h/g^2", "coefficients"},
            {"sigma", Type::f64, {kN}, "deg/h, deg/h/g, deg/h/g^2", "standard deviations"}};
}

std::vector<ColumnSpec> event_columns() {
    return {{"time_ns", Type::i64, {}, "ns", kTimeText},
            {"utc_ns", Type::i64, {}, "ns", "UTC since 1970"},
            {"severity", Type::text, {8}, "", "info, warning, alarm or trip"},
            {"source", Type::text, {16}, "", "who says so"},
            {"text", Type::text, {320}, "", "what happened"}};
}

template <typename T, std::size_t N>
void put(Table& table, const std::array<T, N>& values) {
    table.put_bytes(values.data(), sizeof values);
}

std::uint8_t byte(bool value) { return value ? 1 : 0; }

/// What the dwell says of the coefficients, all in numbers.
void put_row(Table& table, const std::optional<estimator::DwellRow>& of) {
    std::array<double, 3> rate{}, ramp{}, ramp_sigma{};
    std::array<double, 9> covariance{};
    std::array<double, kN> regressors{};
    estimator::LevelTensor gamma{};
    double middle_s = 0, sync = 0;
    if (of) {
        middle_s = of->middle_s;
        sync = of->sync_arcsec;
        gamma = of->vibration.gamma;
        for (std::size_t j = 0; j < 3; ++j) {
            const auto g = static_cast<Eigen::Index>(j);
            rate[j] = of->rate[g];
            ramp[j] = of->ramp[g];
            ramp_sigma[j] = std::sqrt(of->ramp_variance(g, g));
            for (std::size_t k = 0; k < 3; ++k)
                covariance[3 * j + k] = of->variance(g, static_cast<Eigen::Index>(k));
            for (std::size_t t = 0; t < kTerms; ++t)
                regressors[kTerms * j + t] = of->regressors(
                    g, static_cast<Eigen::Index>(estimator::internal_of(kTerms * j + t) / 3));
        }
    } else {
        const double none = std::nan("");
        middle_s = sync = none;
        for (auto* values : {&rate, &ramp, &ramp_sigma}) values->fill(none);
        covariance.fill(none);
        regressors.fill(none);
        gamma.fill(none);
    }
    table.put(middle_s);
    put(table, rate);
    put(table, covariance);
    put(table, regressors);
    put(table, ramp);
    put(table, ramp_sigma);
    put(table, gamma);
    table.put(sync);
}

/// For programs that read no attributes, such as GNU Octave. Numbers of 64 bits are texts: few keep
/// them whole.
std::string head_json(const Head& head, const nlohmann::ordered_json& units) {
    const nlohmann::ordered_json json{{"name", head.name},
                                      {"started_by", head.started_by},
                                      {"started_utc_ns", std::to_string(head.utc_ns)},
                                      {"utc_offset_ns", std::to_string(head.utc_offset_ns)},
                                      {"simulated", head.simulated},
                                      {"version", head.version},
                                      {"campaign", head.campaign},
                                      {"part", head.part},
                                      {"restart", head.restart},
                                      {"dwells_before", head.dwells_before},
                                      {"units", units}};
    return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// Under another name until others can open it: whoever is killed meanwhile leaves nothing that
/// looks like a recording.
std::string new_file(const std::string& path) {
    std::error_code ignored;
    std::filesystem::remove(path + ".new", ignored);
    return path + ".new";
}

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

void put_sample(Table& table, const drivers::Sample& sample) {
    table.put(sample.time).put(sample.sequence).put(sample.dropped_before);
    put(table, sample.angle);
    put(table, sample.force);
    table.put(sample.table_accel);
    table.put_bytes(sample.quality.data(), drivers::kChannels);
}

void write_end(File& file, const Ended& ended) {
    file.set("/", "state", ended.state);
    file.set("/", "reason", ended.reason);
    file.set("/", "mark", ended.mark);
    file.set("/", "ended_utc_ns", ended.utc_ns);
    const nlohmann::ordered_json json{{"state", ended.state},
                                      {"reason", ended.reason},
                                      {"mark", ended.mark},
                                      {"ended_utc_ns", std::to_string(ended.utc_ns)}};
    file.write_text("/ended",
                    json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace),
                    "how it ended, JSON, as in the attributes");
}

void put_gap(Table& table, const Gap& gap) {
    table.put(gap.from).put(gap.to).put(std::string_view(gap.stream)).put(gap.lost);
    table.put(std::string_view(gap.reason));
}

CampaignWriter::CampaignWriter(const std::string& path, const Head& head)
    : file_(std::make_unique<File>(File::create(new_file(path)))),
      lock_(std::make_unique<WriterLock>(file_->path())),
      interlock_rows_(head.interlock_rows) {
    write_head(head);
    nlohmann::ordered_json units;
    const auto table = [&](const char* name, std::vector<ColumnSpec> columns, std::size_t chunk,
                           const char* description) {
        for (const ColumnSpec& column : columns) units[name + 1][column.name] = column.unit;
        return std::make_unique<Table>(*file_, name, std::move(columns), chunk, description);
    };
    samples_ = table("/samples", sample_columns(), 1024, "one row for each instant of the rig");
    orders_ = table("/orders", order_columns(), 16, "dwells as they were ordered");
    dwells_ = table("/dwells", dwell_columns(), 4, "dwells done");
    sweeps_ = table("/sweeps", swept_columns(), 256,
                    "frequency in sweeps as the controller said it; between two rows its logarithm "
                    "goes straight");
    played_ = table("/played", played_columns(), 16, "random dwells as they were played");
    psd_lines_ = table("/psd_lines", psd_columns(), 256, "the controller's PSDs of random dwells");
    estimates_ = table("/estimates", estimate_columns(), 64, "the filter while it works");
    events_ = table("/events", event_columns(), 16, "what happened");
    gaps_ = table("/gaps", gap_columns(), 16, "what is missing in this recording");
    conditions_ = table("/conditions", condition_columns(interlock_rows_), 64,
                        "around the measurement, once a second");
    file_->write_text("/head", head_json(head, units), "some of the attributes, and units, JSON");
    file_->start_swmr(path);
}

void CampaignWriter::write_head(const Head& head) {
    file_->set("/", "format", "vibrig-campaign");
    file_->set("/", "format_version", kFormatVersion);
    file_->set("/", "description",
               "Identification of the gyro error coefficients of an inertial platform on a "
               "vibration rig");
    file_->set("/", "name", head.name);
    file_->set("/", "started_by", head.started_by);
    file_->set("/", "started_utc_ns", head.utc_ns);
    file_->set("/", "utc_offset_ns", head.utc_offset_ns);
    file_->set("/", "clock", head.clock);
    file_->set("/", "simulated", static_cast<std::int64_t>(head.simulated));
    file_->set("/", "version", head.version);
    file_->set("/", "compiler", head.compiler);
    file_->set("/", "instruction_set", head.instruction_set);
    file_->set("/", "configuration_hash", head.configuration_hash);
    file_->set("/", "campaign", head.campaign);
    file_->set("/", "part", static_cast<std::int64_t>(head.part));
    file_->set("/", "restart", static_cast<std::int64_t>(head.restart));
    file_->set("/", "dwells_before", static_cast<std::int64_t>(head.dwells_before));
    file_->set("/", "state", "running");
    if (!head.journal_head.empty()) file_->set("/", "journal_head", head.journal_head);
    std::string names;
    for (const char* name : estimator::parameter_names())
        names += (names.empty() ? "" : " ") + std::string(name);
    file_->set("/", "coefficients", names);
    file_->write_text("/configuration", head.configuration, "effective configuration, TOML");
    file_->write_text("/dbc", head.dbc, "signals on the bus");
    file_->write_text("/interlocks", head.interlocks, "rows of the interlock's table, JSON");
    file_->write_text("/proof", head.proof, "proofs of the safe state before the campaign, JSON");
    file_->write_text("/plan", head.plan, "positions (deg) and levels at the table (g), JSON");
}

void CampaignWriter::order(const Order& order) {
    orders_->put(order.announced).put(order.from).put(order.to);
    orders_->put(std::int32_t{order.run}).put(std::int32_t{order.position}).put(order.table_g);
    orders_->put(byte(order.cancel));
    put(*orders_, order.zero_g);
    orders_->put(order.level_sigma_g).put(order.noise.angle_arcsec);
    put(*orders_, order.noise.gyro_random_walk_deg_per_rt_h);
    orders_->put(order.begin_s).put(byte(order.power_lost));
    orders_->put(order.frequency_hz).put(byte(order.held_out));
    const auto& random = order.random;
    orders_->put(std::int32_t{random.profile}).put(random.level_db).put(random.mean_square_g2);
    orders_->put(random.bandwidth_hz).put(random.gain_error).put(random.highest_hz);
    orders_->put(order.sweep.from_hz).put(order.sweep.to_hz).put(order.sweep.seconds);
}

void CampaignWriter::swept(const Swept& swept) {
    for (const SweptRow& row : swept.rows)
        sweeps_->put(row.time).put(row.run).put(row.position).put(row.frequency_hz);
}

void CampaignWriter::played(const Played& played) {
    const auto& [word, random, seen, place] = played.random;
    played_->put(played.from).put(played.run).put(played.position);
    played_->put(static_cast<std::uint8_t>(word)).put(random.mean_square_g2);
    played_->put(random.bandwidth_hz).put(random.gain_error).put(random.highest_hz);
    played_->put(seen.share).put(seen.error);
    for (const auto& [hz, density] : played.psd) psd_lines_->put(played.from).put(hz).put(density);
}

void CampaignWriter::dwell(const Dwell& dwell) {
    const auto& s = dwell.summary;
    dwells_->put(dwell.time).put(std::int32_t{s.run}).put(std::int32_t{s.position});
    dwells_->put(s.samples).put(s.used).put(s.rejected).put(s.reinitialised);
    dwells_->put(s.kappa).put(s.amplitude_g).put(s.frequency_hz).put(s.mean_force_g);
    dwells_->put(s.nis_per_dof).put(s.innovation_correlation).put(byte(s.flagged));
    dwells_->put(std::string_view(dwell.reason));
    put(*dwells_, dwell.value);
    put(*dwells_, dwell.sigma);
    std::array<std::uint8_t, kN> observable{};
    std::ranges::transform(dwell.observable, observable.begin(), byte);
    put(*dwells_, observable);
    std::vector<double> covariance = dwell.covariance;
    covariance.resize(kN * kN);
    dwells_->put_bytes(covariance.data(), covariance.size() * sizeof(double));
    put_row(*dwells_, dwell.row);
}

void CampaignWriter::estimate(const EstimateRow& row) {
    estimates_->put(row.time).put(row.amplitude_g).put(row.frequency_hz).put(row.kappa);
    estimates_->put(row.nis_per_dof);
    put(*estimates_, row.innovation_arcsec);
    put(*estimates_, row.value);
    put(*estimates_, row.sigma);
}

void CampaignWriter::condition(const ConditionRow& row) {
    const auto put_flag = [this](int flag) { conditions_->put(std::int32_t{flag}); };
    conditions_->put(row.time).put(row.temperature_c);
    put(*conditions_, row.sensor_c);
    conditions_->put(row.command_g).put(row.command_hz).put(row.set_point_g);
    conditions_->put(row.set_point_hz).put(row.measured_g);
    conditions_->put(row.witness_platform_g).put(row.witness_table_g).put(row.shaker_state);
    for (const int flag : {int{row.shaker_running}, int{row.emergency_stop_open}, int{row.ready},
                           int{row.loop_closed}, int{row.gyros_at_speed}, int{row.fault},
                           int{row.in_position}, int{row.slewing}})
        put_flag(flag);
    if (interlock_rows_ == 0) return;
    std::vector<double> value = row.interlock_value;
    value.resize(interlock_rows_, std::nan(""));
    std::vector<std::uint8_t> raised = row.interlock_raised;
    raised.resize(interlock_rows_);
    conditions_->put_bytes(value.data(), value.size() * sizeof(double));
    conditions_->put_bytes(raised.data(), raised.size());
}

void CampaignWriter::event(const EventRecord& event) {
    events_->put(event.time).put(event.utc_ns).put(std::string_view(name_of(event.severity)));
    events_->put(std::string_view(event.source)).put(std::string_view(event.text));
}

void CampaignWriter::commit() {
    // Samples last: whoever sees a sample also sees the order that it belongs to.
    for (auto* table : {&orders_, &dwells_, &sweeps_, &played_, &psd_lines_, &estimates_, &events_,
                        &gaps_, &conditions_, &samples_})
        (*table)->commit();
    file_->flush();
}

void CampaignWriter::end(const Ended& ended) {
    commit();
    for (auto* table : {&orders_, &dwells_, &sweeps_, &played_, &psd_lines_, &estimates_, &events_,
                        &gaps_, &conditions_, &samples_})
        table->reset();
    const std::string path = file_->path();
    file_->close();
    // While a file is written with readers, no attribute can be added.
    File file = File::open(path, File::Mode::write);
    write_end(file, ended);
    if (!ended.journal_head.empty()) file.set("/", "journal_head", ended.journal_head);
    file.write_text("/result", ended.result_json, "final result, JSON as vibrig identify --json");
    const auto result = nlohmann::json::parse(ended.result_json, nullptr, false);
    if (result.is_object() && result.contains("spectrum") && result.at("spectrum").is_object())
        file.write_text("/spectrum", result.at("spectrum").dump(),
                        "coefficients over frequency, JSON as in the result");
    file.close();
}

}  // namespace vibrig::record
