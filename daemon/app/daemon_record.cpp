// What the daemon tells the recorder.
#include <spdlog/fmt/chrono.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "daemon/app/daemon.hpp"
#include "daemon/version.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "proto/text.hpp"

namespace vibrig {

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
        for (const double table_g : settings.table_g) {
            for (const auto& position : settings.positions_deg) add(position, table_g);
        }
    }
    return nlohmann::ordered_json{
        {"adaptive", settings.adaptive}, {"dwell_s", settings.dwell_s}, {"runs", runs}}
        .dump();
}

}  // namespace

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
    auto recorder = std::make_unique<record::Recorder>(
        settings, folder, clock_, *recorder_waiter_,
        [this](Severity severity, const std::string& text) { log(severity, "recorder", text); });
    recorder->watch([this] { return estimator_stage_.view().estimate; });
    return recorder;
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
    head.plan = plan_json(configuration_.campaign);
    head.interface =
        configuration_.can.kind == drivers::CanPortSettings::Kind::socketcan ? configuration_.can.interface : "vcan0";
    head.restart = dwells_before > 0;
    head.dwells_before = dwells_before;
    recorder_->campaign_begun(std::move(head));
}

void Daemon::record_dwell(const estimator::DwellSummary& summary) {
    if (!recorder_) return;
    // The identification is this thread's: the dwell is over and no other is ordered.
    estimator::Estimate estimate;
    identification_.estimate(estimate);
    record::Dwell dwell;
    dwell.time = clock_.now();
    dwell.summary = summary;
    dwell.reason = summary.reason;
    dwell.value = estimate.value;
    dwell.sigma = estimate.sigma;
    dwell.observable = estimate.observable;
    dwell.covariance = identification_.covariance();
    recorder_->dwell_done(std::move(dwell));
}

}  // namespace vibrig
