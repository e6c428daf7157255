// What the daemon does because nobody is there: journal and restart, alarms, stages that got stuck.
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <filesystem>

#include "daemon/app/daemon.hpp"
#include "daemon/record/journal_anchors.hpp"

namespace vibrig {

using drivers::Time;

namespace {
// A stage that has made no progress for this long keeps the shaker's watchdog hungry.
constexpr Time kProgressDeadline = drivers::kSecond;
// A stage that makes no progress for this long, in wall time, is stuck.
constexpr Time kPatience = 2 * drivers::kSecond;
// The server waits for nobody longer than 0.1 s; on a busy machine it has its turn late.
constexpr Time kServerPatience = 7 * drivers::kSecond;
// That make a bus alive.
constexpr std::uint64_t kFramesWithoutTime = 20;
constexpr double kRateTolerance = 0.01, kRateJitter_s = 0.02;
constexpr std::size_t kManyEvents = serve::EventLog::kCapacity;
}  // namespace

void Daemon::open_journal() {
    auto path = configuration_.journal;
    if (path.empty() && !configuration_.results.empty())
        path = (std::filesystem::path(configuration_.results) / "journal.sqlite3").string();
    if (path.empty()) return;
    journal_ = std::make_unique<journal::Journal>(
        path, journal::configuration_hash(result_configuration()),
        [this](double free_mb) { interlock_.disk_free(free_mb); }, journal_anchors());
    for (const auto& refused : journal_->recovery().refused)
        log(Severity::warning, "journal", refused);
    if (const auto& begins = journal_->recovery().begins; !begins.empty())
        log(Severity::warning, "journal", begins);
    if (const auto& assumed = journal_->recovery().assumed; !assumed.empty())
        log(Severity::warning, "journal", assumed);
    if (const auto& found = journal_->recovery().out_of_band; !found.empty()) {
        campaign_.take_over_loop_check(found);
        log(Severity::warning, "journal", "the newest loop check was out of band: " + found);
    }
    std::vector<campaign::ProofRecord> proofs;
    for (const auto& text : journal_->recovery().proofs) {
        if (auto record = campaign::proof_from_json(text)) {
            proofs.push_back(std::move(*record));
        } else {
            log(Severity::warning, "journal", "a proof of the safe state cannot be read: left out");
        }
    }
    campaign_.take_over_proofs(std::move(proofs));
    if (!book_.trouble().empty()) log(Severity::warning, "commissioning", book_.trouble());
    take_over_latches();
    if (auto& campaign = journal_->recovery().campaign) offer_unfinished(*campaign);
    journal_->on_written([this] { control_waiter_->wake(); });
    estimator_stage_.feed_to(journal_->fed());
    journal_->start();
}

/// Heads that the newest recordings carry: the journal has to go through them.
std::vector<journal::Anchor> Daemon::journal_anchors() const {
    const auto& folder = configuration_.record.folder;
    return record::journal_anchors(folder.empty() ? configuration_.results : folder);
}

std::string Daemon::result_configuration() const {
    std::string text;
    for (const auto& value : loaded_.effective) {
        const auto section = value.key.substr(0, value.key.find('.'));
        if (section == "server" || section == "log" || section == "threads" ||
            section == "journal" || section == "archive" || section == "mqtt" ||
            section == "clock" || section == "guard" || section == "annunciator" ||
            section == "record" || section == "unit" || section == "instrument" ||
            section == "selftest" || section == "commission" || value.key == "campaign.results" ||
            value.key == "campaign.arming_valid_s" || value.key == "campaign.second_person")
            continue;
        text += value.key + " = " + value.value + "\n";
    }
    return text;
}

void Daemon::offer_unfinished(journal::Unfinished& campaign) {
    Interrupted fresh{
        estimator::Identification(configuration_.estimator),
        noise::NoiseMonitor(configuration_.estimator, [](Severity, const std::string&) {}),
        campaign.id};
    std::vector<estimator::DwellSummary> done;
    std::string why =
        journal::replay(campaign.dwells, {fresh.identification, fresh.noise,
                                          drivers::from_seconds(configuration_.campaign.dwell_s)});
    std::vector<StopDone> stops;
    for (const auto& dwell : campaign.dwells) {
        done.push_back(dwell.summary);
        if (dwell.stop_known) stops.push_back(dwell.stop);
    }
    const std::size_t count = done.size();
    if (why.empty() && !campaign_.offer(std::move(done), std::move(stops)))
        why = "its positions are not the first ones of this campaign";
    if (!why.empty()) {
        log(Severity::warning, "journal",
            fmt::format("campaign {} ({}): {}: cold start", campaign.id, campaign.name, why));
        return;
    }
    log(Severity::warning, "journal",
        fmt::format("campaign {} ({}, started by {}) was interrupted with {} positions done: arm "
                    "and resume it, or start anew",
                    campaign.id, campaign.name, campaign.started_by, count));
    interrupted_ = std::move(fresh);
    campaign.dwells.clear();
}

std::unique_ptr<record::PreTrip> Daemon::make_pre_trip() {
    if (configuration_.results.empty()) return nullptr;
    return std::make_unique<record::PreTrip>(
        (std::filesystem::path(configuration_.results) / "trips").string(),
        configuration_.assembler.sample_period, [this] { return event_log_.after(0, kManyEvents); },
        [this](Severity severity, const std::string& text) { log(severity, "pre-trip", text); });
}

std::string Daemon::resume_gate() const {
    if (!interrupted_) return "the filter as it was is gone";
    const auto view = acquisition_.view();
    const auto& sample = view.sample;
    const Time now = clock_.now();
    if (now - sample.time > drivers::kSecond || !sample.angles_good() || !sample.force_good())
        return "no good sample within the last second";
    if (view.platform.time == 0 || now - view.platform.time > configuration_.gimbal.status_deadline)
        return "no platform status";
    // The shaker rests: the accelerometers see gravity, as they did before.
    constexpr double kGravityTolerance = 0.05;
    double square = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        double force = 0;
        for (std::size_t j = 0; j < 3; ++j) {
            force += configuration_.estimator.accelerometer_matrix[i][j] *
                     (sample.force[j] - configuration_.estimator.accelerometer_zero_g[j]);
        }
        square += force * force;
    }
    if (!(std::abs(std::sqrt(square) - 1) <= kGravityTolerance))
        return fmt::format("specific force {:.3f} g at rest, expected 1 g within {:g} g",
                           std::sqrt(square), kGravityTolerance);
    return {};
}

void Daemon::check_balance(Time now) {
    if (now - balance_checked_ < drivers::kSecond) return;
    balance_checked_ = now;
    const auto a = acquisition_.view();
    const auto e = estimator_stage_.view();
    std::string found;
    const auto equal = [&found](const char* what, std::uint64_t left, std::uint64_t right) {
        if (left != right) found += fmt::format("{}: {} is not {}; ", what, left, right);
    };
    equal("frames received", a.port.received,
          a.port.delivered + a.port.own + a.port.error_frames + a.port.malformed);
    equal("frames delivered", a.port.delivered,
          a.assembler.received + a.rig_ticks + a.increments + a.in_hand);
    equal("frames for samples", a.assembler.received,
          a.assembler.used + a.assembler.unknown + a.assembler.duplicate + a.assembler.late +
              a.assembler.wrong_length);
    equal("samples offered", a.samples_offered, a.assembler.samples);
    equal("samples taken", e.taken, e.in_dwell + e.idle);
    if (log_queue_ != nullptr) {
        const auto lines = log_queue_->counts();
        equal("lines logged", lines.taken, lines.written + lines.dropped + lines.waiting);
    }
    if (!found.empty() && imbalance_.empty())
        log(Severity::alarm, "balance", "received is not handled + dropped: " + found);
    imbalance_ = found;
}

std::string Daemon::clock_misfit() const {
    const auto view = acquisition_.view();
    if (rig_clock_)
        return view.rig_ticks == 0 && port_->counters().delivered > kFramesWithoutTime
                   ? "clock.source is \"rig\", but no simulated rig sends its time on the bus: "
                     "vibrig-plant --clock rig, or clock.source = \"real\""
                   : "";
    // Frames of that number may be anybody's on a real bus; with samples they are no matter.
    const bool sampled =
        view.sample.time != 0 && clock_.now() - view.sample.time <= drivers::kSecond;
    return view.foreign_time > 0 && !sampled
               ? "clock.source is \"real\", but a simulated rig that owns the time (RigTime on the "
                 "bus) waits for an answer: vibrig-plant --clock real, or clock.source = \"rig\""
               : "";
}

std::string Daemon::rate_misfit() const {
    const auto view = acquisition_.view();
    const bool sampled =
        view.sample.time != 0 && clock_.now() - view.sample.time <= 2 * drivers::kSecond;
    const auto rate = sampled ? view.rate : rt::RateMeter{};
    const double configured = 1 / drivers::to_seconds(configuration_.assembler.sample_period);
    if (const auto link = port_->state(); link != drivers::PortState::running) {
        const auto& port = configuration_.can;
        return fmt::format("the CAN bus is lost: {}: {}",
                           port.path.empty() ? port.interface : port.path, drivers::name_of(link));
    }
    if (!sampled) return "the rig is silent: no complete sample for 2 s";
    const auto measured = [&rate] {
        return rate.hz() == 0 ? std::string("no sample rate measured yet")
                              : fmt::format("{:.4g} samples/s measured", rate.hz());
    };
    // The ends of what is measured may be late by so much.
    const double tolerance = kRateTolerance + kRateJitter_s / std::max(rate.span_s(), 0.5);
    if (rate.hz() > 0 && std::abs(rate.hz() / configured - 1) <= tolerance) return {};
    return fmt::format("{}, can.sample_rate_hz = {:g}: expected within {:g} %", measured(),
                       configured, 100 * kRateTolerance);
}

void Daemon::tell_clock_misfit() {
    auto found = clock_misfit();
    if (found == misfit_told_) return;
    log(found.empty() ? Severity::info : Severity::alarm, "clock",
        found.empty() ? "rig and daemon agree on the time" : found);
    misfit_told_ = std::move(found);
}

std::string Daemon::stuck_stage() {
    tell_clock_misfit();
    // In wall time. The simulated rig's clock may stand still, and with it all that waits on it.
    if (rig_clock_) return {};
    const auto wall = std::chrono::duration_cast<std::chrono::nanoseconds>(
                          std::chrono::steady_clock::now().time_since_epoch())
                          .count();
    const auto acquired = acquisition_.view();
    const auto ring = estimator_stage_.ring();
    struct Stage {
        const char* name;
        std::uint64_t mark;  ///< changes as long as the stage goes on
        bool may_rest;       ///< nothing to do
        Time patience;
    };
    const auto& shaker = configuration_.shaker;
    const std::array<Stage, 4> stages{
        {{"acquisition", static_cast<std::uint64_t>(acquired.beat), false, kPatience},
         {"estimator", ring.popped, ring.popped == ring.pushed, kPatience},
         {"control", static_cast<std::uint64_t>(control_beat_.load()), false, kPatience},
         // Connecting takes its time when nobody is there.
         {"shaker link", shaker_->beats(), false,
          2 * shaker.backoff_max + 8 * shaker.response_timeout}}};
    std::string stuck;
    for (std::size_t i = 0; i < stages.size(); ++i) {
        if (stages[i].may_rest || progress_[i].since_ns == 0 ||
            progress_[i].mark != stages[i].mark) {
            progress_[i] = {stages[i].mark, wall};
        } else if (wall - progress_[i].since_ns > stages[i].patience) {
            stuck += (stuck.empty() ? "" : ", ") + std::string(stages[i].name);
        }
    }
    return stuck;
}

void Daemon::refused(const std::string& who, const std::string& what, const std::string& why) {
    log(Severity::warning, "server", fmt::format("refused {} ({}): {}", what, who, why));
}

void Daemon::tell_alarms() {
    for (std::size_t i = 0; i < interlock_.rows(); ++i) {
        const auto row = interlock_.row(i);
        if (row.raised == raised_[i] || row.rule->reaction != rt::Reaction::alarm) continue;
        raised_[i] = row.raised;
        const auto& condition = rt::condition_of(row.rule->condition);
        if (!row.raised) {
            log(Severity::info, "interlock", fmt::format("{}: over", row.rule->name));
        } else if (condition.has_limit()) {
            log(Severity::alarm, "interlock",
                fmt::format("{}: {}: {:.4g}, limit {:.4g} {}", row.rule->name, condition.text,
                            row.value, row.rule->limit, condition.unit));
        } else {
            log(Severity::alarm, "interlock",
                fmt::format("{}: {}", row.rule->name, condition.text));
        }
    }
}

void Daemon::tell_controller() {
    using drivers::ControllerState;
    const auto now = port_->counters().controller;
    if (std::exchange(controller_told_, now) == now) return;
    log(now == ControllerState::active    ? Severity::info
        : now == ControllerState::warning ? Severity::warning
                                          : Severity::alarm,
        "can", fmt::format("the controller's error state: {}", drivers::name_of(now)));
}

double Daemon::longest_end_s() const {
    const auto& campaign = configuration_.campaign;
    // The ramp down and its grace, then the stop and its verdict.
    return campaign.ramp_s + 2 * campaign.stop.deadline_s +
           campaign.stop.pads.from_s(campaign.max_acceleration_g) +
           3 * drivers::to_seconds(configuration_.shaker.watchdog_period);
}

bool Daemon::may_feed() const noexcept {
    const auto reading = shaker_->reading();
    if (starving_.load() || campaign_.stopping() || (reading.running && !excitation_.load()))
        return false;
    const Time now = clock_.now();
    const Time oldest = std::min(
        {acquisition_.view().beat, estimator_stage_.view().sample_time, control_beat_.load()});
    return now - oldest <= kProgressDeadline;
}

void Daemon::tell_watchdog() {
    const auto reading = shaker_->reading();
    if (!reading.valid) return;
    const bool changed = reading.watchdog == drivers::WatchdogTimeout::changed;
    if (std::exchange(watchdog_was_changed_, changed) == changed) return;
    log(changed ? Severity::alarm : Severity::info, "shaker",
        fmt::format("the controller's watchdog timeout reads {:g} s, {}",
                    reading.watchdog_timeout_s,
                    changed ? "not what was written: nobody is armed" : "as written"));
}

void Daemon::told(Severity severity, const std::string& text) { log(severity, "server", text); }

StatusData Daemon::serving(const ServerStatus& server) {
    serving_wall_ns_.store(rt::wall_clock());
    {
        const std::lock_guard lock(mutex_);
        server_status_ = server;
    }
    return status();
}

void Daemon::watch_onlookers() {
    const auto served = serving_wall_ns_.load();
    interlock_.onlookers(recorder_ && recorder_->degraded(),
                         served != 0 && rt::wall_clock() - served > kServerPatience);
}

void Daemon::tell_log() {
    if (log_queue_ == nullptr) return;
    const auto lines = log_queue_->counts();
    if (std::exchange(log_was_blocked_, lines.blocked) == lines.blocked) return;
    log(Severity::warning, "log",
        lines.blocked ? "nobody takes its lines: a stopped terminal, a full pipe or a dead disk; "
                        "events and journal go on without it"
                      : fmt::format("goes on; {} lines lost so far", lines.dropped));
}

void Daemon::tell_journal() {
    for (const std::string& found : journal_->take_found()) {
        // In the new file it stands already.
        latches_.add({journal::kJournalLatch, found, {}, {}, false, utc_now()});
        log(Severity::alarm, "journal", found + ": vibrig ack journal");
    }
    const auto status = journal_->status();
    if (std::exchange(journal_was_running_, status.running) == status.running) return;
    log(status.running ? Severity::info : Severity::alarm, "journal",
        status.running ? "writes again" : "entries wait: " + status.note);
}

InterlockStatus Daemon::interlock_status(std::vector<Latch> latches) const {
    InterlockStatus status;
    status.latches = std::move(latches);
    status.tripped = interlock_.name_of(interlock_.latched());
    for (const Latch& latch : status.latches) {
        if (status.tripped.empty() && latch.name != journal::kJournalLatch)
            status.tripped = latch.name;
    }
    for (std::size_t i = 0; i < interlock_.rows(); ++i) {
        const auto row = interlock_.row(i);
        const auto& condition = rt::condition_of(row.rule->condition);
        status.rows.push_back({row.rule->name, condition.name,
                               row.rule->reaction == rt::Reaction::abort ? "abort" : "alarm",
                               condition.unit, row.rule->limit, row.rule->dwell_s,
                               condition.has_limit(), row.rule->latched, row.raised, row.value,
                               row.present, condition.below});
    }
    const auto reactions = interlock_.reactions();
    status.reaction_bounds_ms.assign(rt::ReactionHistogram::kBounds_ms.begin(),
                                     rt::ReactionHistogram::kBounds_ms.end());
    status.reaction_counts.assign(reactions.count.begin(), reactions.count.end());
    status.reaction_largest_ms = reactions.largest_ms;
    status.reaction_sum_ms = reactions.sum_ms;
    return status;
}

}  // namespace vibrig
