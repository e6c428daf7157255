// Who watches from outside: vibrig-guard, and the people that horn and pager reach.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

#include "daemon/app/daemon.hpp"

namespace vibrig {

using drivers::HornPattern;

proto::DaemonWord Daemon::word_for_guard() {
    proto::DaemonWord word;
    const auto ring = estimator_stage_.ring();
    // Who has nothing to do goes on as well: an estimator without samples, a link that is sought.
    if (ring.popped == ring.pushed) ++marks_[0];
    if (shaker_->state() != drivers::LinkState::running) ++marks_[1];
    word.progress = {static_cast<std::uint64_t>(acquisition_.view().beat), ring.popped + marks_[0],
                     static_cast<std::uint64_t>(control_beat_.load()),
                     shaker_->beats() + marks_[1]};
    word.armed = armed_.load();
    word.excitation = excitation_.load();
    word.stop_ordered = campaign_.stopping();
    word.level_g = armed_g_.load();
    return word;
}

double Daemon::highest_level() const {
    if (campaign_status_.armed_by.empty()) return 0;
    const auto& campaign = configuration_.campaign;
    if (campaign_status_.state == CampaignState::checking) return campaign.loop.table_g;
    return campaign.table_g.empty() ? 0 : *std::ranges::max_element(campaign.table_g);
}

std::string Daemon::guard_refuses(const CommandRequest& request) const {
    using Kind = CommandRequest::Kind;
    const bool moves = request.kind == Kind::arm || request.kind == Kind::start ||
                       request.kind == Kind::resume || request.kind == Kind::selftest;
    if (!guard_link_ || !moves) return {};
    const auto guard = guard_link_->status();
    if (!guard.heard) return "vibrig-guard is not heard: " + guard.note;
    if (!guard.text.empty()) return "vibrig-guard: " + guard.text + "; acknowledge it at rest";
    if (!guard.sees) return "vibrig-guard sees no accelerometer";
    if (!guard.reaches_shaker) return "vibrig-guard does not reach the shaker";
    return {};
}

void Daemon::tell_campaign(Severity severity, const std::string& text) {
    enter(severity, "campaign", text);
    // Whoever is not there wants to know that it does not go on.
    if (severity == Severity::alarm) annunciator_->announce(HornPattern::abort, text);
}

void Daemon::on_disobeyed(bool disobeyed) {
    interlock_.stop_disobeyed(disobeyed);
    disobeyed_ = disobeyed;
    if (disobeyed)
        annunciator_->announce(HornPattern::disobeyed, rt::text_of(rt::Trip::stop_disobeyed));
}

void Daemon::watch_outside() {
    bool lost = false;
    auto cause = proto::GuardCause::none;
    if (guard_link_) {
        const auto guard = guard_link_->status();
        lost = !guard.heard;
        if (std::exchange(guard_was_heard_, guard.heard) != guard.heard)
            log(guard.heard ? Severity::info : Severity::warning, "guard",
                guard.heard ? "heard" : "not heard: " + guard.note);
        cause = guard_link_->finding();
        const auto number = guard_link_->word().finding;
        if (cause != proto::GuardCause::none && std::exchange(guard_finding_, number) != number)
            log(Severity::trip, "guard",
                fmt::format("{}: {}", proto::name_of(cause), proto::text_of(cause)));
        if (std::exchange(guard_was_disobeyed_, guard.disobeyed) != guard.disobeyed &&
            guard.disobeyed)
            annunciator_->announce(HornPattern::disobeyed,
                                   proto::text_of(proto::GuardCause::stop_disobeyed));
    }
    const auto annunciator = annunciator_->status();
    interlock_.outside(lost, cause != proto::GuardCause::none,
                       annunciator.horn && !annunciator.confirms);
    show_state();
}

void Daemon::show_state() {
    auto pattern = HornPattern::none;
    if (std::ranges::find(raised_, true) != raised_.end()) pattern = HornPattern::alarm;
    if (interlock_.latched() || latches_.tripped()) pattern = HornPattern::abort;
    if (disobeyed_) pattern = HornPattern::disobeyed;
    if (guard_link_ && guard_link_->heard()) {
        const auto guard = guard_link_->word();
        if (guard.disobeyed && !guard.rest) pattern = HornPattern::disobeyed;
    }
    annunciator_->show(pattern);
}

}  // namespace vibrig
