#include "daemon/record/campaign_writer.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "daemon/record/campaign_columns.hpp"
#include "daemon/record/digest.hpp"
#include "proto/json_text.hpp"

namespace vibrig::record {

using hdf5::ColumnSpec;
using hdf5::File;
using hdf5::Table;

namespace {

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
                                      {"channels", channel_names().now},
                                      {"units", units}};
    return proto::json_text(json);
}

/// Under another name until others can open it: whoever is killed meanwhile leaves nothing that
/// looks like a recording.
std::string new_file(const std::string& path) {
    std::error_code ignored;
    std::filesystem::remove(path + ".new", ignored);
    return path + ".new";
}

}  // namespace

void write_end(File& file, const Ended& ended) {
    file.set("/", "state", ended.state);
    file.set("/", "reason", ended.reason);
    file.set("/", "mark", ended.mark);
    file.set("/", "ended_utc_ns", ended.utc_ns);
    const nlohmann::ordered_json json{{"state", ended.state},
                                      {"reason", ended.reason},
                                      {"mark", ended.mark},
                                      {"ended_utc_ns", std::to_string(ended.utc_ns)}};
    file.write_text("/ended", proto::json_text(json), "how it ended, JSON, as in the attributes");
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
    ConditionRow condition;
    condition.interlock_value.resize(interlock_rows_);
    condition.interlock_raised.resize(interlock_rows_);
    samples_ =
        table("/samples", specs_of(drivers::Sample{}), 1024, "one row for each instant of the rig");
    orders_ = table("/orders", specs_of(Order{}), 16, "dwells as they were ordered");
    dwells_ = table("/dwells", specs_of(Dwell{}, DwellNumbers{}), 4, "dwells done");
    sweeps_ = table("/sweeps", specs_of(SweptRow{}), 256,
                    "frequency in sweeps as the controller said it; between two rows its logarithm "
                    "goes straight");
    played_ = table("/played", specs_of(Played{}), 16, "random dwells as they were played");
    psd_lines_ =
        table("/psd_lines", specs_of(PsdLine{}), 256, "the controller's PSDs of random dwells");
    estimates_ = table("/estimates", specs_of(EstimateRow{}), 64, "the filter while it works");
    events_ = table("/events", specs_of(EventRecord{}), 16, "what happened");
    gaps_ = table("/gaps", specs_of(Gap{}), 16, "what is missing in this recording");
    conditions_ =
        table("/conditions", specs_of(condition), 64, "around the measurement, once a second");
    file_->write_text("/head", head_json(head, units), "some of the attributes, and units, JSON");
    file_->start_swmr(path);
}

void CampaignWriter::write_head(const Head& head) {
    file_->set("/", "format", "vibrig-campaign");
    file_->set("/", "format_version", kFormatVersion);
    file_->set("/", "description",
               "Identification of the gyro error coefficients of an inertial platform on a "
               "vibration rig");
    attributes_of(head, [this](const char* name, const auto& field) {
        if constexpr (std::is_integral_v<std::remove_cvref_t<decltype(field)>>) {
            file_->set("/", name, static_cast<std::int64_t>(field));
        } else {
            file_->set("/", name, field);
        }
    });
    file_->set("/", "state", "running");
    if (!head.journal_head.empty()) file_->set("/", "journal_head", head.journal_head);
    file_->set("/", "coefficients",
               fmt::format("{}", fmt::join(estimator::parameter_names(), " ")));
    file_->set("/", kConfigurationDigest, sha256_of_text(head.configuration));
    file_->write_text("/configuration", head.configuration, "effective configuration, TOML");
    file_->write_text("/dbc", head.dbc, "signals on the bus");
    file_->write_text("/interlocks", head.interlocks, "rows of the interlock's table, JSON");
    file_->write_text("/proof", head.proof, "proofs of the safe state before the campaign, JSON");
    file_->write_text("/plan", head.plan, "positions (deg) and levels at the table (g), JSON");
}

void CampaignWriter::put(const Swept& swept) {
    for (const SweptRow& row : swept) put_row(*sweeps_, row);
}

void CampaignWriter::put(const Played& played) {
    put_row(*played_, played);
    for (const auto& [hz, density] : played.psd)
        put_row(*psd_lines_, PsdLine{played.from, hz, density});
}

void CampaignWriter::put(const Dwell& dwell) {
    Dwell whole = dwell;
    whole.covariance.resize(estimator::kParameters * estimator::kParameters);
    put_row(*dwells_, whole, dwell.numbers.value_or(DwellNumbers{}));
}

void CampaignWriter::put(const ConditionRow& row) {
    ConditionRow whole = row;
    whole.interlock_value.resize(interlock_rows_, std::nan(""));
    whole.interlock_raised.resize(interlock_rows_);
    put_row(*conditions_, whole);
}

void CampaignWriter::put(const drivers::Sample& sample) { put_row(*samples_, sample); }
void CampaignWriter::put(const Order& order) { put_row(*orders_, order); }
void CampaignWriter::put(const EstimateRow& row) { put_row(*estimates_, row); }
void CampaignWriter::put(const EventRecord& event) { put_row(*events_, event); }
void CampaignWriter::put(const Gap& gap) { put_row(*gaps_, gap); }

void CampaignWriter::commit() {
    for (auto* table : tables()) (*table)->commit();
    file_->flush();
}

void CampaignWriter::end(const Ended& ended) {
    commit();
    for (auto* table : tables()) table->reset();
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
