// What the daemon watches because nobody else is there.
#include "daemon/app/supervisor.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <utility>

namespace vibrig {

using drivers::Time;

namespace {
// A stage that has made no progress for this long keeps the shaker's watchdog hungry.
constexpr Time kProgressDeadline = drivers::kSecond;
// A stage that makes no progress for this long, in wall time, is stuck.
constexpr Time kPatience = 2 * drivers::kSecond;
// The server waits for nobody longer than 0.1 s; on a busy machine it has its turn late.
constexpr Time kServerPatience = 7 * drivers::kSecond;
}  // namespace

void Supervisor::look(const std::string& guard_lacks) {
    tell_alarms(guard_lacks);
    tell_controller();
    tell_watchdog();
    if (journal_) tell_journal();
    if (recorder_) tell_recorder();
    watch_onlookers();
    tell_log();
}

void Supervisor::check_balance(Time now) {
    if (now - balance_checked_ < drivers::kSecond) return;
    balance_checked_ = now;
    Counted counted;
    counted.shaker = shaker_->counters();
    counted.acquisition = acquisition_.view();
    counted.estimator = estimator_stage_.view();
    counted.ring = estimator_stage_.ring();
    if (recorder_) counted.recorder = recorder_->samples().counts();
    if (journal_) counted.journal = journal_->status();
    if (log_queue_ != nullptr) counted.log = log_queue_->counts();
    const std::string found = balance_.look(counted);
    if (!found.empty() && imbalance_.empty())
        log(Severity::alarm, "balance", "received is not handled + dropped: " + found);
    imbalance_ = found;
    tell_contradiction(counted.acquisition.assembler, now);
}

void Supervisor::tell_contradiction(const drivers::AssemblerCounters& counters, Time now) {
    // Whoever sends another's id does so with every sample: it is said again once a minute.
    constexpr Time kAgain = 60 * drivers::kSecond;
    if (counters.contradicting == contradicting_ ||
        (contradicting_ > 0 && now - contradiction_told_ < kAgain))
        return;
    log(Severity::alarm, "can",
        fmt::format("two nodes send id {0} ({0:#x}): {1} of its frames say otherwise than the one "
                    "before of the same count, and are left out",
                    counters.contradicting_id, counters.contradicting - contradicting_));
    contradicting_ = counters.contradicting;
    contradiction_told_ = now;
}

void Supervisor::tell_clock_misfit() {
    auto found = parts_.fitness.clock_misfit();
    if (found == misfit_logged_) return;
    log(found.empty() ? Severity::info : Severity::alarm, "clock",
        found.empty() ? "rig and daemon agree on the time" : found);
    misfit_logged_ = std::move(found);
}

std::string Supervisor::stuck_stage() {
    tell_clock_misfit();
    // In wall time. The simulated rig's clock may stand still, and with it all that waits on it.
    if (!parts_.in_real_time()) return {};
    const Time wall = drivers::steady_now();
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

void Supervisor::tell_alarms(const std::string& guard_lacks) {
    for (std::size_t i = 0; i < interlock_.rows(); ++i) {
        const auto row = interlock_.row(i);
        if (row.raised == raised_[i] || row.rule->reaction != rt::Reaction::alarm) continue;
        raised_[i] = row.raised;
        const auto& condition = rt::condition_of(row.rule->condition);
        if (!row.raised) {
            log(Severity::info, "interlock", fmt::format("{}: over", row.rule->name));
        } else if (row.rule->condition == rt::Trip::guard_lost && !guard_lacks.empty()) {
            log(Severity::alarm, "interlock", row.rule->name + ": vibrig-guard " + guard_lacks);
        } else if (condition.has_limit()) {
            log(Severity::alarm, "interlock",
                fmt::format("{}: {}: {}, limit {:.4g} {}", row.rule->name, condition.text,
                            std::isnan(row.value) ? "not known" : fmt::format("{:.4g}", row.value),
                            row.rule->limit, condition.unit));
        } else {
            log(Severity::alarm, "interlock",
                fmt::format("{}: {}", row.rule->name, condition.text));
        }
    }
}

void Supervisor::tell_controller() {
    using drivers::ControllerState;
    const auto now = parts_.port->counters().controller;
    if (std::exchange(controller_logged_, now) == now) return;
    log(now == ControllerState::active    ? Severity::info
        : now == ControllerState::warning ? Severity::warning
                                          : Severity::alarm,
        "can", fmt::format("the controller's error state: {}", drivers::name_of(now)));
}

bool Supervisor::may_feed() const noexcept {
    const auto reading = shaker_->reading();
    if (parts_.rig.starving() || parts_.campaign.stopping() ||
        (reading.running && !parts_.rig.excitation()))
        return false;
    const Time now = parts_.clock.now();
    const Time oldest = std::min(
        {acquisition_.view().beat, estimator_stage_.view().sample_time, control_beat_.load()});
    return now - oldest <= kProgressDeadline;
}

void Supervisor::tell_watchdog() {
    const auto reading = shaker_->reading();
    if (!reading.valid) return;
    const bool changed = reading.watchdog == drivers::WatchdogTimeout::changed;
    if (std::exchange(watchdog_was_changed_, changed) == changed) return;
    log(changed ? Severity::alarm : Severity::info, "shaker",
        fmt::format("the controller's watchdog timeout reads {:g} s, {}",
                    reading.watchdog_timeout_s,
                    changed ? "not what was written: nobody is armed" : "as written"));
}

void Supervisor::watch_onlookers() {
    const auto served = serving_steady_ns_.load();
    interlock_.onlookers(recorder_ && recorder_->degraded(),
                         served != 0 && drivers::steady_now() - served > kServerPatience);
}

void Supervisor::tell_log() {
    if (log_queue_ == nullptr) return;
    const auto lines = log_queue_->counts();
    if (std::exchange(log_was_blocked_, lines.blocked) == lines.blocked) return;
    log(Severity::warning, "log",
        lines.blocked ? "nobody takes its lines: a stopped terminal, a full pipe or a dead disk; "
                        "events and journal go on without it"
                      : fmt::format("goes on; {} lines lost so far", lines.dropped));
}

void Supervisor::tell_journal() {
    for (const std::string& found : journal_->take_found()) {
        // In the new file it stands already.
        latches_.add({journal::kJournalLatch, found, {}, {}, false, utc_now()});
        log(Severity::alarm, "journal", found + kJournalToDo);
        // What the start said of it stands in the file that was put aside.
        log(Severity::info, "configuration", parts_.in_force());
    }
    const auto status = journal_->status();
    if (std::exchange(journal_was_running_, status.running) == status.running) return;
    log(status.running ? Severity::info : Severity::alarm, "journal",
        status.running ? "writes again" : "entries wait: " + status.note);
}

void Supervisor::tell_recorder() {
    const double stuck_s = recorder_->stuck_s();
    const bool stuck = stuck_s > 0;
    if (std::exchange(recorder_was_stuck_, stuck) == stuck) return;
    log(stuck ? Severity::alarm : Severity::info, "recorder",
        stuck ? "does not go on, as with a disk that does not answer: what comes meanwhile waits, "
                "and is lost when there is no more room for it"
              : "goes on again");
}

}  // namespace vibrig
