#include "daemon/record/campaign_writer.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/record/campaign_columns.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::record {

using hdf5::ColumnSpec;
using hdf5::File;
using hdf5::Table;

namespace {

constexpr std::size_t kN = estimator::kParameters;
constexpr std::size_t kTerms = kN / 3;

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
