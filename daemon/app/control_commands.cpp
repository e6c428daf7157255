// Commands, and what of them outlives the daemon: armings and latches go into the journal first,
// and end there by name.
#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>

#include <chrono>

#include "daemon/app/control_loop.hpp"
#include "daemon/configuration/cross_checks.hpp"

namespace vibrig {

using drivers::Time;

namespace {

// For the journal to have an arming or an acknowledgement on disk; the server waits for an answer
// for 5 s.
constexpr Time kDiskPatience = 2 * drivers::kSecond;

/// A proof of the safe state is what proves the shaker's parts.
commission::Part last_part_for(const CommandRequest& request) {
    return request.kind == CommandRequest::Kind::arm ? commission::Part::excitation
                                                     : commission::Part::gyros;
}

}  // namespace

void ControlLoop::take_commands(Time now) {
    std::deque<WaitingCommand> taken;
    {
        const std::lock_guard lock(mutex_);
        taken.swap(commands_);
    }
    finish_arming(now);
    finish_acknowledging(false);
    finish_certificates(false);
    for (auto& waiting : taken) {
        if (waiting.abandoned->exchange(true)) continue;
        const auto kind = waiting.request.kind;
        if (kind == CommandRequest::Kind::abort) give_up_arming("aborted by " + waiting.request.by);
        if (kind == CommandRequest::Kind::commission) {
            commission(std::move(waiting), now);
        } else if (kind == CommandRequest::Kind::certificate) {
            begin_certificate(std::move(waiting));
        } else if (kind == CommandRequest::Kind::arm || kind == CommandRequest::Kind::selftest) {
            begin_arming(std::move(waiting), now);
        } else if (kind == CommandRequest::Kind::acknowledge) {
            entry_of_acknowledgement_ = 0;
            auto reply = acknowledge(waiting.request, now);
            if (entry_of_acknowledgement_ == 0)
                answer(waiting, reply);
            else
                acknowledging_.push_back({std::move(waiting), std::move(reply),
                                          entry_of_acknowledgement_, drivers::steady_now()});
        } else {
            const auto unfit = not_fit_to_shake(waiting.request);
            answer(waiting, unfit.empty() ? campaign_.command(waiting.request, now)
                                          : CommandReply{false, unfit});
        }
    }
}

void ControlLoop::answer(WaitingCommand& waiting, const CommandReply& reply) {
    const CommandRequest& request = waiting.request;
    const bool started = reply.accepted && request.kind == CommandRequest::Kind::start;
    const auto resumed = dwells_.take_resumed();
    if (journal_) {
        journal_->command(request, reply, utc_now());
        if (started) journal_->campaign_begun(configuration_.campaign.name, request.by);
    }
    if (started || resumed) record_begin(request.by, resumed.value_or(0));
    if (started && configuration_.simulated())
        log(Severity::info, "campaign",
            "SIMULATED: the rig is a program, nothing of this is a measurement");
    reply_later(waiting, reply);
}

void ControlLoop::reply_later(WaitingCommand& waiting, CommandReply reply) {
    replies_.emplace_back(std::move(waiting.reply), std::move(reply));
}

void ControlLoop::give_replies() {
    for (auto& [to, reply] : replies_) to.set_value(std::move(reply));
    replies_.clear();
}

std::string ControlLoop::not_fit_to_arm(const CommandRequest& request, Time now) const {
    // The adapter may have been plugged in since the configuration was read.
    if (const auto& can = configuration_.can;
        configuration_.commission.simulated &&
        can.kind == drivers::CanPortSettings::Kind::socketcan &&
        configuration::is_hardware(can.interface))
        return fmt::format("commission.simulated is true, and the CAN interface {} is a device",
                           can.interface);
    // First: what is proved of a rig that is not the one described says little.
    if (auto why = book_.refusal(utc_now(), last_part_for(request)); !why.empty()) return why;
    if (request.kind == CommandRequest::Kind::selftest && first_shaking())
        if (auto why = registers_not_tried(); !why.empty()) return why;
    if (auto why = campaign_.refusal(request, now); !why.empty()) return why;
    if (auto why = device_not_known(); !why.empty()) return why;
    if (auto why = outside_.refuses(request); !why.empty()) return why;
    if (const Latch* changed = latches_.find(journal::kJournalLatch))
        return changed->cause + kJournalToDo;
    if (const auto why = journal_being_verified(); !why.empty()) return why;
    if (arming_) return "another arming is being written to the journal";
    if (journal_ || parts_.rig_clock) return {};
    return "no journal is kept, found campaign.results and journal.file empty: a trip would be "
           "forgotten by a restart";
}

/// Of an armed rig: what may have come since.
std::string ControlLoop::not_fit_to_shake(const CommandRequest& request) const {
    if (auto why = outside_.refuses(request); !why.empty()) return why;
    if (request.kind != CommandRequest::Kind::start && request.kind != CommandRequest::Kind::resume)
        return {};
    const Latch* const changed = latches_.find(journal::kJournalLatch);
    return changed == nullptr ? std::string() : changed->cause + kJournalToDo;
}

/// Until all of it was looked at nobody knows what it says of trips and proofs.
std::string ControlLoop::journal_being_verified() const {
    if (!journal_) return {};
    const auto journal = journal_->status();
    if (journal.verified) return {};
    return fmt::format("the journal is still being verified ({:.0f} %): arm it then{}",
                       100 * journal.verified_part,
                       journal.not_watched.empty() ? "" : "; " + journal.not_watched);
}

/// Whether this shaker's numbers are still to be understood: its first proof goes up slowly.
bool ControlLoop::first_shaking() const {
    if (!configuration_.record_demanded()) return false;
    const auto standing = book_.standing(utc_now());
    return !standing[static_cast<std::size_t>(commission::Part::units)].proven ||
           !standing[static_cast<std::size_t>(commission::Part::registers)].proven;
}

void ControlLoop::begin_arming(WaitingCommand waiting, Time now) {
    take_attendance(waiting.request);
    if (waiting.request.kind == CommandRequest::Kind::selftest &&
        waiting.request.argument == campaign::kRestCheck)
        return begin_rest_check(waiting, now);
    campaign_.climb_next_proof(first_shaking());
    if (const auto why = not_fit_to_arm(waiting.request, now); !why.empty()) {
        if (why == book_.refusal(utc_now(), last_part_for(waiting.request)))
            commissioning_.enter({"", "", waiting.request.by, "", "refused arm",
                                  commission::Json{{"why", why}}.dump()});
        return answer(waiting, {false, why});
    }
    if (!journal_) {  // on the rig's clock
        auto reply = campaign_.command(waiting.request, now);
        if (reply.accepted) reply.message += tell_overdue();
        return answer(waiting, reply);
    }
    const auto entry = journal_->armed(waiting.request.by, campaign_.arming_text(waiting.request));
    arming_.emplace(Arming{std::move(waiting), entry, drivers::steady_now()});
}

void ControlLoop::finish_arming(Time now) {
    if (!arming_) return;
    if (!journal_->on_disk(arming_->entry)) {
        if (drivers::steady_now() - arming_->since_steady < kDiskPatience) return;
        const auto status = journal_->status();
        return give_up_arming(
            fmt::format("the journal has not written the arming within {:g} s: {}",
                        drivers::to_seconds(kDiskPatience),
                        status.running ? "the disk does not answer" : status.note));
    }
    Arming arming = std::move(*arming_);
    arming_.reset();
    // Whatever has happened since it was asked: a journal that was lost by this very writing, too.
    const auto unfit = not_fit_to_arm(arming.waiting.request, now);
    auto reply =
        unfit.empty() ? campaign_.command(arming.waiting.request, now) : CommandReply{false, unfit};
    if (reply.accepted) {
        if (arming.waiting.request.kind == CommandRequest::Kind::arm)
            reply.message += tell_overdue();
        armed_by_ = arming.waiting.request.by;
    } else {
        journal_->disarmed(arming.waiting.request.by, reply.message);
    }
    answer(arming.waiting, reply);
}

void ControlLoop::give_up_arming(const std::string& why) {
    if (!arming_) return;
    Arming arming = std::move(*arming_);
    arming_.reset();
    journal_->disarmed(arming.waiting.request.by, why);
    answer(arming.waiting, {false, why});
}

void ControlLoop::finish_acknowledging(bool at_once) {
    std::erase_if(acknowledging_, [&](Acknowledging& one) {
        if (!journal_->on_disk(one.entry)) {
            if (!at_once && drivers::steady_now() - one.since_steady < kDiskPatience) return false;
            one.reply.message +=
                "; the journal has not written it yet: after a restart it may have to be said "
                "again";
        }
        answer(one.waiting, one.reply);
        return true;
    });
}

void ControlLoop::watch_arming() {
    if (armed_by_.empty() || !campaign_.armed_by().empty()) return;
    StatusData status;
    campaign_.fill(status, parts_.clock.now());
    end_arming(status.reason.empty() ? name_of(status.state) : status.reason);
}

void ControlLoop::end_arming(const std::string& why) {
    if (armed_by_.empty()) return;
    if (journal_) journal_->disarmed(armed_by_, why);
    armed_by_.clear();
}

void ControlLoop::latch(Latch latch) {
    latch.utc_ns = utc_now();
    if (journal_) journal_->latched(latch);
    latches_.add(std::move(latch));
}

/// The stop at the start makes the controller forget its faults, which is nobody's acknowledgement.
void ControlLoop::judge_first_reading(Time now) {
    const auto& reading = first_reading_;
    // Whether it counts as old: the rig's clock may have jumped to the rig's time meanwhile.
    if (reading.fault == 0 && reading.state != drivers::kShakerFault) return;
    const bool emergency = reading.emergency_stop_open;
    // Of a trip that is not acknowledged yet it is a part.
    if (latches_.tripped() && !emergency) return;
    const std::string cause =
        fmt::format("the shaker's controller held fault {:#06x} when the daemon started{}",
                    reading.fault, emergency ? ", the emergency-stop chain open" : "");
    latch({rt::condition_of(emergency ? rt::Trip::emergency_stop : rt::Trip::shaker_fault).name,
           cause,
           {},
           {},
           emergency && configuration_.campaign.second_person});
    campaign_.on_trip(latches_.causes(), now);
    events_.announce(drivers::HornPattern::abort, cause);
}

/// The emergency stop comes after a trip, or where nothing is guarded, too: it is no interlock's
/// then, and still wants its persons.
void ControlLoop::watch_emergency_stop(Time now) {
    const auto reading = shaker_->reading();
    if (!reading.fresh || !first_reading_judged_) return;
    const bool open = reading.emergency_stop_open;
    if (emergency_was_open_ == open) return;
    const bool at_start = !emergency_was_open_;
    const bool tripped = latches_.tripped();
    // Its own row trips, or has tripped and is reported next.
    if (open && !tripped && (interlock_.latched() || !campaign_.armed_by().empty())) return;
    emergency_was_open_ = open;
    const char* const name = rt::condition_of(rt::Trip::emergency_stop).name;
    if (!open || at_start || latches_.find(name) != nullptr) return;
    // What was aborted a moment ago is still to come to rest.
    if (!tripped && !configuration_.campaign.second_person && !campaign_.stopping()) return;
    const std::string text = rt::text_of(rt::Trip::emergency_stop);
    log(Severity::warning, "interlock", text + (tripped ? " after the trip" : ""));
    events_.announce(drivers::HornPattern::abort, text);
    latch({name, text, armed_by_last(), {}, configuration_.campaign.second_person});
    if (tripped) return campaign_.take_over_trip(latches_.causes());
    campaign_.on_trip(latches_.causes(), now);
}

/// The stop of another trip: the interlock has its first cause, and a restart is to know this one.
void ControlLoop::watch_disobeyed() {
    const auto& disobeyed = rt::condition_of(rt::Trip::stop_disobeyed);
    const rt::Tripped first = interlock_.latched();
    if (!parts_.rig.is_disobeyed() || !first || first.cause == disobeyed.trip ||
        !(first == handled_) || latches_.find(disobeyed.name) != nullptr)
        return;
    latch({disobeyed.name, disobeyed.text, armed_by_last(), {}, false});
}

/// Who armed what is under way, or what the open latches are of.
std::string ControlLoop::armed_by_last() const {
    std::string armed_by = campaign_.armed_by();
    for (const Latch& latch : latches_.open())
        if (armed_by.empty()) armed_by = latch.armed_by;
    return armed_by;
}

void ControlLoop::on_trip(const rt::Tripped& tripped, Time now) {
    // Its stop may be read back before it is told: then it is nobody's else.
    const std::string guard = tripped.cause == rt::Trip::guard_stop ? "" : outside_.guard_found();
    const std::string text =
        interlock_.text_of(tripped) + (guard.empty() ? "" : "; vibrig-guard has found: " + guard);
    latch({interlock_.name_of(tripped),
           text,
           campaign_.armed_by(),
           {},
           tripped.cause == rt::Trip::emergency_stop && configuration_.campaign.second_person});
    campaign_.on_trip(text, now);
    events_.announce(drivers::HornPattern::abort, text);
    watch_arming();
    if (!parts_.pre_trip) return;
    parts_.pre_trip->tripped(
        {rt::condition_of(tripped.cause).name, interlock_.name_of(tripped), text, now, utc_now()});
}

CommandReply ControlLoop::acknowledge_alarm(const CommandRequest& request) {
    if (request.by.empty() || !interlock_.acknowledge_alarm(request.argument)) return {};
    log(Severity::info, "interlock",
        fmt::format("alarm {} acknowledged by {}", request.argument, request.by));
    return {true, "acknowledged: " + request.argument};
}

std::string ControlLoop::unknown_to_acknowledge(const CommandRequest& request) const {
    const std::string& what = request.argument;
    if (what.empty() || what == "trip" || what == "shaker" || latches_.find(what) != nullptr ||
        what == interlock_.name_of(interlock_.latched()))
        return {};
    std::string names;
    for (const Latch& latch : latches_.open()) names += latch.name + ", ";
    return fmt::format(
        "found \"{}\", expected {}", what,
        names.empty() ? "the name of an alarm that is raised, trip or shaker" : names + "or trip");
}

CommandReply ControlLoop::acknowledge(const CommandRequest& request, Time now) {
    if (const auto alarm = acknowledge_alarm(request); alarm.accepted) return alarm;
    if (const auto unknown = unknown_to_acknowledge(request); !unknown.empty())
        return {false, unknown};
    const bool of_journal = request.argument == journal::kJournalLatch;
    const bool was_tripped = latches_.tripped();
    if (!of_journal) {
        if (const auto why = campaign_.refusal(request, now); !why.empty()) return {false, why};
    }
    std::string still;
    if (of_journal || was_tripped) {
        const auto answer =
            latches_.acknowledge(request.argument.empty() ? "trip" : request.argument, request.by);
        if (!answer.accepted) return {false, answer.words};
        for (const auto& [names, last] : {std::pair(&answer.over, true), {&answer.first, false}}) {
            for (const std::string& name : *names) {
                if (journal_)
                    entry_of_acknowledgement_ = journal_->acknowledged(name, request.by, last);
            }
        }
        if (of_journal || latches_.tripped()) {
            log(Severity::info, "interlock", fmt::format("{} by {}", answer.words, request.by));
            if (latches_.tripped()) {
                still = "; still latched: " + latches_.causes();
                campaign_.take_over_trip(latches_.causes());  // what is over is no reason any more
            }
            return {true, answer.words + still};
        }
    }
    auto reply = campaign_.command(request, now);
    if (reply.accepted) {
        // First what would trip it again.
        outside_.acknowledge();
        watch_outside();
        interlock_.acknowledge(handled_);
    }
    return reply;
}

std::string ControlLoop::tell_overdue() {
    std::string overdue;
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    const std::string day = fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
    for (const auto& instrument : configuration_.paperwork.instruments) {
        if (!instrument.overdue(day)) continue;
        const auto words = fmt::format("{} {}: certificate {} was due on {}", instrument.name,
                                       instrument.serial, instrument.certificate, instrument.due);
        log(Severity::warning, "paperwork", words);
        overdue += "; warning: " + words;
    }
    return overdue;
}

}  // namespace vibrig
