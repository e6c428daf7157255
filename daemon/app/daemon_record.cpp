// What the daemon tells the recorder, and its result file.
#include <spdlog/fmt/chrono.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "daemon/app/daemon.hpp"
#include "daemon/version.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "proto/text.hpp"

namespace vibrig {

using drivers::Time;

namespace {

constexpr std::size_t kLargestDbc = 16 << 20;

std::string dbc_text(const std::string& path) {
    return path.empty() ? std::string(proto::rig_dbc_text())
                        : proto::read_whole_file(path, kLargestDbc);
}

std::string plan_json(const campaign::Settings& settings) {
    nlohmann::ordered_json runs = nlohmann::ordered_json::array();
    const auto add = [&runs](const std::array<double, 3>& position_deg, double table_g) {
        runs.push_back({{"position", position_deg}, {"table_g", table_g}});
    };
    for (const auto& stop : settings.stops) add(stop.position_deg, stop.table_g);
    if (settings.stops.empty() && !settings.adaptive) {
        const std::size_t positions = settings.positions_deg.size();
        for (std::size_t i = 0; i < settings.table_g.size() * positions; ++i) {
            const std::size_t at = settings.sequence.empty() ? i : settings.sequence[i];
            add(settings.positions_deg[at % positions], settings.table_g[at / positions]);
        }
    }
    return nlohmann::ordered_json{
        {"adaptive", settings.adaptive}, {"dwell_s", settings.dwell_s}, {"runs", runs}}
        .dump();
}

std::string interlock_table(const rt::Interlock& interlock) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < interlock.rows(); ++i) {
        const rt::Rule& rule = *interlock.row(i).rule;
        const auto& condition = rt::condition_of(rule.condition);
        rows.push_back({{"name", rule.name},
                        {"condition", condition.name},
                        {"reaction", rule.reaction == rt::Reaction::abort ? "abort" : "alarm"},
                        {"limit", condition.has_limit() ? nlohmann::ordered_json(rule.limit)
                                                        : nlohmann::ordered_json(nullptr)},
                        {"unit", condition.unit},
                        {"dwell_s", rule.dwell_s}});
    }
    return rows.dump();
}

}  // namespace

record::ConditionRow Daemon::conditions() const {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    // Each comes once a second.
    constexpr Time kSensorDeadline = 5 * drivers::kSecond;
    record::ConditionRow row;
    row.time = clock_.now();
    const auto platform = acquisition_.view().platform;
    const auto fresh = [&](Time time, Time deadline) {
        return time != 0 && row.time - time <= deadline;
    };
    const auto flag = [](bool set) { return static_cast<std::int8_t>(set ? 1 : 0); };
    const Time deadline = configuration_.gimbal.status_deadline;
    row.temperature_c = fresh(platform.time, deadline) ? platform.temperature_c : kNone;
    for (std::size_t i = 0; i < platform.sensor_c.size(); ++i)
        row.sensor_c[i] =
            fresh(platform.sensor_time[i], kSensorDeadline) ? platform.sensor_c[i] : kNone;
    if (fresh(platform.time, deadline)) {
        row.ready = flag(platform.ready);
        row.loop_closed = flag(platform.loop_closed);
        row.gyros_at_speed = flag(platform.gyros_at_speed);
        row.fault = flag(platform.fault);
    }
    if (fresh(platform.gimbal_time, deadline)) {
        row.in_position = flag(platform.in_position);
        row.slewing = flag(platform.slewing);
    }
    {
        const std::lock_guard lock(mutex_);
        row.command_g = campaign_status_.command_table_g;
        row.command_hz = campaign_status_.command_frequency_hz;
    }
    const auto shaker = shaker_->reading();
    row.set_point_g = shaker.valid ? shaker.amplitude_g : kNone;
    row.set_point_hz = shaker.valid ? shaker.frequency_hz : kNone;
    row.measured_g = shaker.valid ? shaker.measured_g : kNone;
    if (shaker.valid) {
        row.shaker_state = shaker.state;
        row.shaker_running = flag(shaker.running);
        row.emergency_stop_open = flag(shaker.emergency_stop_open);
    }
    const auto seen = interlock_.seen_g();
    row.witness_platform_g = seen[0] < 0 ? kNone : seen[0];
    row.witness_table_g = seen[1] < 0 ? kNone : seen[1];
    for (std::size_t i = 0; i < interlock_.rows(); ++i) {
        const auto state = interlock_.row(i);
        row.interlock_value.push_back(state.present);
        row.interlock_raised.push_back(state.raised ? 1 : 0);
    }
    return row;
}

std::string Daemon::tell_overdue() {
    std::string told;
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    const std::string day = fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
    for (const auto& instrument : configuration_.paperwork.instruments) {
        if (!instrument.overdue(day)) continue;
        const auto words = fmt::format("{} {}: certificate {} was due on {}", instrument.name,
                                       instrument.serial, instrument.certificate, instrument.due);
        log(Severity::warning, "paperwork", words);
        told += "; warning: " + words;
    }
    return told;
}

drivers::CanPort& Daemon::sending_port() noexcept {
    return sent_tap_ ? static_cast<drivers::CanPort&>(*sent_tap_) : *port_;
}

std::unique_ptr<record::Recorder> Daemon::make_recorder() {
    const record::Settings& settings = configuration_.record;
    const std::string& folder = settings.folder.empty() ? configuration_.results : settings.folder;
    if (!settings.enabled || folder.empty()) return nullptr;
    recorder_waiter_ = clock_.make_waiter();
    auto recorder =
        std::make_unique<record::Recorder>(settings, folder, clock_, *recorder_waiter_,
                                           [this](Severity severity, const std::string& text) {
                                               log(severity, "recorder", text);
                                               if (outbox_) outbox_->look();
                                           });
    recorder->watch([this] { return estimator_stage_.view().estimate; },
                    [this] { return conditions(); });
    recorder->sign_with([this] { return journal_ ? journal_->status().head : std::string(); });
    return recorder;
}

/// What is recorded is delivered; it goes by the recordings' folder alone.
void Daemon::open_outbox() {
    if (configuration_.archive.folder.empty() || !recorder_) return;
    outbox_ = std::make_unique<archive::Outbox>(
        configuration_.archive,
        configuration_.record.folder.empty() ? configuration_.results
                                             : configuration_.record.folder,
        configuration_.paperwork.unit_serial,
        [this](Severity severity, const std::string& text) { log(severity, "archive", text); });
    outbox_->start();
}

void Daemon::tell_recorder() {
    const double stuck_s = recorder_->stuck_s();
    const bool stuck = stuck_s > 0;
    if (std::exchange(recorder_was_stuck_, stuck) == stuck) return;
    log(stuck ? Severity::alarm : Severity::info, "recorder",
        stuck ? "does not go on, as with a disk that does not answer: what comes meanwhile waits, "
                "and is lost when there is no more room for it"
              : "goes on again");
}

void Daemon::record_begin(const std::string& by, std::size_t dwells_before) {
    if (!recorder_) return;
    const auto utc_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                            std::chrono::system_clock::now().time_since_epoch())
                            .count();
    record::Head head;
    head.name = configuration_.campaign.name;
    head.started_by = by;
    head.utc_ns = utc_ns;
    head.utc_offset_ns = (utc_ns - clock_.now()) / drivers::kMicrosecond * drivers::kMicrosecond;
    head.clock = rig_clock_ ? "rig" : "real";
    head.simulated = configuration_.simulated();
    head.version = kVersion;
    head.compiler = estimator::compiler();
    head.instruction_set = estimator::instruction_set();
    head.configuration = configuration::format_effective(loaded_);
    head.configuration_hash =
        fmt::format("{:016x}", journal::configuration_hash(result_configuration()));
    try {
        head.dbc = dbc_text(configuration_.dbc);
    } catch (const std::exception& error) {
        log(Severity::warning, "recorder", configuration_.dbc + ": " + error.what());
    }
    head.proof = campaign_.proofs_json();
    head.plan = plan_json(configuration_.campaign);
    head.interface =
        configuration_.can.kind == drivers::CanPortSettings::Kind::socketcan ? configuration_.can.interface : "vcan0";
    head.interlocks = interlock_table(interlock_);
    head.interlock_rows = interlock_.rows();
    head.restart = dwells_before > 0;
    head.dwells_before = dwells_before;
    recorder_->campaign_begun(std::move(head));
}

void Daemon::record_dwell(const estimator::DwellSummary& summary, const estimator::Result& result) {
    if (!recorder_) return;
    // The identification is this thread's: the dwell is over and no other is ordered.
    estimator::Estimate estimate;
    identification_.solved(estimate);
    record::Dwell dwell;
    dwell.time = clock_.now();
    dwell.summary = summary;
    dwell.reason = summary.reason;
    dwell.value = estimate.value;
    dwell.sigma = estimate.sigma;
    dwell.observable = estimate.observable;
    dwell.covariance = identification_.covariance();
    if (!summary.left_out && !result.rows.empty() && result.rows.back().run == summary.run &&
        result.rows.back().position == summary.position)
        dwell.row = result.rows.back();
    recorder_->dwell_done(std::move(dwell));
}

void Daemon::write_result_file(const std::string& text, bool complete) {
    if (configuration_.results.empty()) return;
    // A partial result never takes the place of a complete one.
    const auto path = std::filesystem::path(configuration_.results) /
                      (complete ? "result.json" : "result-partial.json");
    auto unfinished = path;
    unfinished += ".new";
    std::ofstream file(unfinished);
    file << text;
    file.close();
    std::error_code error;
    if (file) std::filesystem::rename(unfinished, path, error);
    if (!file || error) {
        log(Severity::alarm, "campaign", "cannot write " + path.string());
    } else {
        log(Severity::info, "campaign",
            fmt::format("{} result in {}", complete ? "complete" : "partial", path.string()));
    }
}

}  // namespace vibrig
