#include "daemon/serve/readiness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "daemon/serve/expiry_watch.hpp"

namespace vibrig::serve {
namespace {

std::string seconds(double value) { return fmt::format("{:.1f} s", value); }

/// Whether it writes, and is what was written into it.
Readiness::Check journal_check(const StatusData& status) {
    const auto& journal = status.journal;
    const char* const name = "journal";
    if (journal.path.empty()) return {name, true, "none is kept"};
    for (const Latch& latch : status.interlock.latches) {
        if (latch.name == name) return {name, false, latch.cause + kJournalToDo};
    }
    if (!journal.running) return {name, false, journal.note};
    if (!journal.not_watched.empty())
        return {name, false, "cannot be looked at: " + journal.not_watched};
    if (!journal.verified) {
        return {name, false,
                "being verified, " + std::to_string(std::lround(100 * journal.verified_part)) +
                    " % done"};
    }
    return {name, true, "writes; verified, " + std::to_string(journal.entries) + " entries"};
}

}  // namespace

bool Readiness::ready() const {
    return std::all_of(checks.begin(), checks.end(), [](const Check& c) { return c.passed; });
}

std::string Readiness::failures() const {
    std::string text;
    for (const Check& check : checks) {
        if (!check.passed) text += (text.empty() ? "" : "; ") + check.name + ": " + check.text;
    }
    return text;
}

Readiness readiness(const StatusData& status) {
    Readiness found;
    const auto add = [&found](const char* name, bool passed, std::string text) {
        found.checks.push_back({name, passed, std::move(text)});
    };
    add("can", status.can == drivers::PortState::running,
        std::string("link ") + name_of(status.can));
    add("shaker", status.shaker_link == drivers::LinkState::running && status.shaker.valid,
        std::string("link ") + name_of(status.shaker_link) +
            (status.shaker.valid ? "" : ", no reading"));
    add("shaker fault", status.shaker.valid && status.shaker.fault == 0,
        status.shaker.valid ? "fault bits " + std::to_string(status.shaker.fault) : "no reading");
    add("emergency stop", status.shaker.valid && !status.shaker.emergency_stop_open,
        !status.shaker.valid                ? "no reading"
        : status.shaker.emergency_stop_open ? "open"
                                            : "closed");
    // In a campaign it moves as it is commanded; what is not seen is not at rest.
    add("rest",
        !status.stop_pending && !status.rest.disobeyed &&
            std::string_view(status.rest.state) != "unknown",
        std::string(status.rest.state) +
            (status.rest.disobeyed ? ", press the emergency stop" : "") +
            (status.rest.what.empty() ? "" : ": " + status.rest.what));
    const bool timeout_known = status.shaker.watchdog != drivers::WatchdogTimeout::unread;
    add("watchdog", status.shaker.valid && status.shaker.watchdog == drivers::WatchdogTimeout::kept,
        !status.shaker.valid || !timeout_known
            ? "timeout not read"
            : "timeout reads " + seconds(status.shaker.watchdog_timeout_s) +
                  (status.shaker.watchdog == drivers::WatchdogTimeout::kept
                       ? ""
                       : ", not what was written"));
    std::string bad;
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        const auto state = status.channel(c);
        const double age_s = status.channel_age_s[c];
        if (state == ChannelState::unbound || state == ChannelState::good) continue;
        bad += (bad.empty() ? "" : ", ") + std::string(name_of(static_cast<drivers::Channel>(c))) +
               ' ' + name_of(state) + (age_s < 0 ? "" : ", last good " + seconds(age_s) + " ago");
    }
    add("channels", bad.empty(), bad.empty() ? "all good" : bad);
    add("clock", status.clock_misfit.empty(),
        status.clock_misfit.empty() ? "rig and daemon agree" : status.clock_misfit);
    add("sample rate", status.rate_misfit.empty(),
        status.rate_misfit.empty() ? fmt::format("{:.2f} samples/s", status.sample_rate_hz)
                                   : status.rate_misfit);
    const auto& platform = status.platform;
    const auto platform_state = status.platform_state();
    add("platform", platform_state == ChannelState::good && platform.ready && !platform.fault,
        platform.time == 0 ? "no status yet"
        : platform_state == ChannelState::silent
            ? "silent for " + seconds(drivers::to_seconds(status.time - platform.time))
        : platform.fault ? "fault"
        : platform.ready ? "ready"
                         : "not ready");
    add("interlock", status.interlock.tripped.empty(),
        status.interlock.tripped.empty() ? "not tripped" : "tripped: " + status.interlock.tripped);
    const std::string verdict = status.loop_check.verdict;
    // One that was never made says nothing about the loop.
    add("loop check", verdict == "in band",
        verdict.empty()                     ? "none yet"
        : status.loop_check.message.empty() ? verdict
                                            : verdict + ": " + status.loop_check.message);
    add("safe-state proof", status.proof.refusal.empty(),
        !status.proof.refusal.empty() ? status.proof.refusal
        : !status.proof.by.empty()    ? "proved by " + status.proof.by
                                      : "none, none is demanded of a simulated rig");
    if (const auto& guard = status.guard; !guard.socket.empty())
        add("guard", guard.heard && guard.text.empty() && guard.sees && guard.reaches_shaker,
            !guard.heard            ? "not heard: " + guard.note
            : !guard.text.empty()   ? guard.text
            : !guard.sees           ? "sees no accelerometer"
            : !guard.reaches_shaker ? "does not reach the shaker"
            : !guard.note.empty()   ? "watches, " + guard.note
                                    : "watches");
    if (const auto& outside = status.annunciator; outside.horn || outside.command)
        add("annunciator", outside.confirms && outside.command_note.empty(),
            !outside.confirms               ? outside.horn_note
            : !outside.command_note.empty() ? "pager: " + outside.command_note
            : outside.horn                  ? "confirms"
                                            : "pager can be run");
    found.checks.push_back(journal_check(status));
    std::string shut;
    for (const auto& door : status.server.doors)
        if (!door.open) shut += (shut.empty() ? "" : "; ") + door.name + ": " + door.note;
    add("doors", shut.empty(), shut.empty() ? "open" : shut);
    const std::int64_t now_s = status.utc_ns / drivers::kSecond;
    bool expired = false;
    std::string ends;
    for (const auto& certificate : status.server.certificates) {
        if (!certificate.own) continue;
        const bool over = certificate.expires <= now_s;
        expired = expired || over;
        ends += (ends.empty() ? "" : ", ") + certificate.whose + (over ? " EXPIRED " : " until ") +
                date_of(certificate.expires);
    }
    add("certificates", !expired, ends.empty() ? "none in use" : ends);
    add("losses", status.estimator_ring.dropped == 0,
        std::to_string(status.estimator_ring.dropped) + " samples dropped before the filter");
    return found;
}

}  // namespace vibrig::serve
