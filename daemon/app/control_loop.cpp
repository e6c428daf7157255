#include "daemon/app/control_loop.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <utility>

namespace vibrig {

using drivers::Time;

void ControlLoop::run() {
    bool done = false;
    Time next = 0;  // of the campaign
    while (!give_up_.load()) {
        const bool stirred = control_waiter_->take();
        const Time now = parts_.clock.now();
        supervisor_.beat(now);
        const auto words = [this](const RtEvent& event) {
            if (event.dropped_before > 0)
                log(Severity::warning, event.source.data(),
                    fmt::format("{} events lost before the next", event.dropped_before));
            log(event.severity, event.source.data(), event.text.data());
        };
        parts_.port_events.consume(words);
        parts_.shaker_events.consume(words);
        if (const rt::Tripped trip = interlock_.latched(); !(trip == handled_)) {
            if (trip) on_trip(trip, now);
            handled_ = trip;
        }
        if (first_reading_known_.load() && !std::exchange(first_reading_judged_, true))
            judge_first_reading(now);
        watch_emergency_stop(now);
        watch_disobeyed();
        supervisor_.look(outside_.guard_lacks());
        watch_outside();
        interlock_.filter(
            parts_.rig.excitation() ? parts_.estimator_stage.view().estimate.nis_per_dof : 0);
        watch_device(now);
        take_commands(now);
        watch_attendance(now);
        if (shut_down_.load()) campaign_.shut_down(now);
        dwells_.take_done(campaign_);
        // The journal's wake-ups come when the disk is done: polls that began with them would make
        // a campaign on the rig's clock depend on the machine's load.
        if (stirred || now >= next)
            next = std::min(campaign_.step(now), now + drivers::kSecond / 2);
        follow_record(now);
        const Time commissioning = commissioning_.step(now);
        dwells_.take_done(campaign_);
        watch_arming();
        supervisor_.check_balance(now);
        show(now);
        give_replies();
        done = campaign_.done(now) && dwells_.written();
        if (done) break;
        control_waiter_->wait_until(std::min(next, commissioning));
    }
    dwells_.write_out(campaign_);
    give_up_arming("the daemon is shutting down");
    finish_acknowledging(true);
    finish_certificates(true);
    give_replies();
    if (done) end_arming("the daemon has ended in order");
    const std::lock_guard lock(mutex_);
    ended_ = done;
    ended_changed_.notify_all();
    for (auto& waiting : commands_) waiting.reply.set_value({false, "the daemon is shutting down"});
    commands_.clear();
}

/// What everybody sees of the campaign until the next round.
void ControlLoop::show(Time now) {
    const std::lock_guard lock(mutex_);
    // Nobody is to see "finished" before there is a result.
    if (!dwells_.concluding()) campaign_.fill(status_, now);
    if (commissioning_.active()) status_.reason = commissioning_.progress();
    status_.interlock.latches = latches_.open();
    status_.noise = dwells_.noise();
    const bool armed = !campaign_.armed_by().empty();
    outside_.armed(armed, armed ? campaign_.highest_level() : 0, campaign_.platform_ratio());
}

void ControlLoop::watch_outside() {
    outside_.watch(latches_.tripped(), supervisor_.alarm_raised());
}

void ControlLoop::announce_latches() {
    if (latches_.tripped())
        events_.announce(drivers::HornPattern::abort, "not acknowledged: " + latches_.causes());
}

void ControlLoop::first_reading(const drivers::ShakerReading& reading) {
    if (first_reading_known_.load()) return;
    first_reading_ = reading;
    first_reading_known_.store(true);
}

void ControlLoop::record_begin(const std::string& by, std::size_t dwells_before) {
    if (parts_.recorder) parts_.recorder->campaign_begun(recording_head(parts_, by, dwells_before));
}

void ControlLoop::take_over() {
    if (!journal_) return;
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
    book_.expect_signed(journal_->recovery().signed_parts);
    if (const auto& by = journal_->recovery().torqued_by; !by.empty() && parts_.torquer) {
        campaign_.take_over_torque();
        torque_left_ = true;
        log(Severity::warning, "journal",
            "the daemon ended while " + by +
                " let it torque the platform (vibrig commission): zero is commanded");
    }
    std::vector<campaign::ProofRecord> proofs;
    for (const auto& text : journal_->recovery().proofs) {
        std::string why;
        if (auto record = campaign::proof_from_json(text, &why)) {
            proofs.push_back(std::move(*record));
        } else {
            log(Severity::warning, "journal",
                "a proof of the safe state cannot be read, left out: " + why);
        }
    }
    campaign_.take_over_proofs(std::move(proofs));
    proofs_taken_ = campaign_.proof().history().size();
    if (!book_.trouble().empty()) log(Severity::warning, "commissioning", book_.trouble());
    keep_voided();
    keep_trials();
    take_over_latches();
    if (auto& campaign = journal_->recovery().campaign)
        dwells_.offer_unfinished(*campaign, campaign_);
}

void ControlLoop::take_over_latches() {
    for (const Latch& latch : journal_->recovery().latches) {
        latches_.add(latch);
        log(Severity::alarm, "journal",
            fmt::format("not acknowledged: {}: {}{}", latch.name, latch.cause,
                        latch.name == journal::kJournalLatch ? kJournalToDo : ""));
        // Whose word it was is not kept: each witness has to show anew that it lives. An arming
        // without an end may have tripped so, and nobody could write that.
        if (latch.name == rt::condition_of(rt::Trip::stuck).name ||
            latch.name == rt::condition_of(rt::Trip::amplitude_witness).name ||
            latch.name == journal::kDiedArmed) {
            parts_.rest.doubt(drivers::Channel::accel_x);
            parts_.rest.doubt(drivers::Channel::table_accel);
        }
    }
    if (latches_.tripped()) campaign_.take_over_trip(latches_.causes(), true);
}

StatusData ControlLoop::status() const {
    const std::lock_guard lock(mutex_);
    return status_;
}

record::ConditionRow ControlLoop::conditions() const {
    std::unique_lock lock(mutex_);
    const double g = status_.command_table_g, hz = status_.command_frequency_hz;
    lock.unlock();
    return vibrig::conditions(parts_, g, hz);
}

void ControlLoop::shut_down() noexcept {
    shut_down_.store(true);
    control_waiter_->notify();
}

void ControlLoop::give_up() noexcept {
    give_up_.store(true);
    control_waiter_->notify();
}

bool ControlLoop::wait_for_end(double wall_seconds) {
    std::unique_lock lock(mutex_);
    return ended_changed_.wait_for(lock, std::chrono::duration<double>(wall_seconds),
                                   [this] { return ended_; });
}

CommandReply ControlLoop::command(const CommandRequest& request) {
    // A stop does not wait for the control thread.
    if (request.kind == CommandRequest::Kind::abort) shaker_->stop_now();
    const auto abandoned = std::make_shared<std::atomic<bool>>(false);
    std::future<CommandReply> reply;
    {
        const std::lock_guard lock(mutex_);
        if (ended_) return {false, "the daemon is shutting down"};
        reply = commands_.emplace_back(WaitingCommand{request, {}, abandoned}).reply.get_future();
        control_waiter_->notify();
    }
    // A stop is answered within 0.2 s, that it is on its way, whatever holds the rest up.
    // It is not taken back: the campaign ends when the control thread goes on.
    constexpr auto kStopPatience = std::chrono::milliseconds(100);
    if (request.kind == CommandRequest::Kind::abort) {
        if (reply.wait_for(kStopPatience) == std::future_status::ready) return reply.get();
        return {true, "the shaker is ordered to stop; the campaign has not ended yet"};
    }
    if (reply.wait_for(std::chrono::seconds(5)) != std::future_status::ready &&
        !abandoned->exchange(true)) {
        const CommandReply none{false, "no answer from the control thread within 5 s"};
        if (journal_) journal_->command(request, none, utc_now());
        return none;
    }
    return reply.get();
}

}  // namespace vibrig
