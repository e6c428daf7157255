// Who watches from outside: vibrig-guard, and the people that horn and pager reach.
#include "daemon/app/outside.hpp"

#include <spdlog/fmt/fmt.h>

#include <utility>

namespace vibrig {

using drivers::HornPattern;

Outside::Outside(Parts& parts, const Supervisor& supervisor)
    : parts_(parts), supervisor_(supervisor) {}

void Outside::open() {
    annunciator_ = std::make_unique<drivers::Annunciator>(
        parts_.configuration.annunciator, [this](bool good, const std::string& text) {
            events_.log(good ? Severity::info : Severity::alarm, "annunciator", text);
        });
    events_.page_by(annunciator_.get());
    if (const auto& path = parts_.configuration.guard_socket; !path.empty())
        guard_link_ = std::make_unique<watch::GuardLink>(path, [this] { return word(); });
}

void Outside::armed(bool by_somebody, double highest_g, double platform_ratio) noexcept {
    armed_.store(by_somebody);
    armed_g_.store(highest_g);
    platform_ratio_.store(platform_ratio);
}

void Outside::acknowledge() {
    // What somebody could know of: a newer one is reported first.
    if (guard_link_) guard_link_->acknowledge(guard_finding_);
}

void Outside::fill(StatusData& status) const {
    if (guard_link_) status.guard = guard_link_->status();
    if (annunciator_) status.annunciator = annunciator_->status();
}

proto::DaemonWord Outside::word() {
    proto::DaemonWord word;
    const auto ring = parts_.estimator_stage.ring();
    // Who has nothing to do goes on as well: an estimator without samples, a link that is sought.
    if (ring.popped == ring.pushed) ++marks_[0];
    if (parts_.shaker->state() != drivers::LinkState::running) ++marks_[1];
    word.progress = {static_cast<std::uint64_t>(parts_.acquisition.view().beat),
                     ring.popped + marks_[0], supervisor_.control_mark(),
                     parts_.shaker->beats() + marks_[1]};
    word.armed = armed_.load();
    word.excitation = parts_.rig.excitation();
    word.stop_ordered = parts_.campaign.stopping();
    word.level_g = armed_g_.load();
    word.platform_ratio = platform_ratio_.load();
    return word;
}

std::string Outside::refuses(const CommandRequest& request) const {
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

std::string Outside::guard_found() const {
    const auto cause = guard_link_ ? guard_link_->finding() : proto::GuardCause::none;
    return cause == proto::GuardCause::none ? "" : proto::text_of(cause);
}

void Outside::watch(bool tripped, bool alarm) {
    auto cause = proto::GuardCause::none;
    if (guard_link_) {
        const auto guard = guard_link_->status();
        const auto lacked =
            std::exchange(guard_lacks_, guard_eyes_.lacks(guard, drivers::steady_now()));
        if (guard.heard && lacked != guard_lacks_ && (guard_was_heard_ || !guard_lacks_.empty()))
            events_.log(guard_lacks_.empty() ? Severity::info : Severity::warning, "guard",
                        guard_lacks_.empty() ? "sees, and reaches the shaker" : guard_lacks_);
        if (std::exchange(guard_was_heard_, guard.heard) != guard.heard)
            events_.log(guard.heard ? Severity::info : Severity::warning, "guard",
                        (guard.heard ? "heard" : "not heard") +
                            (guard.note.empty() ? "" : ": " + guard.note));
        cause = guard_link_->finding();
        const auto number = guard_link_->word().finding;
        if (cause != proto::GuardCause::none && std::exchange(guard_finding_, number) != number)
            events_.log(Severity::trip, "guard",
                        fmt::format("{}: {}", proto::name_of(cause), proto::text_of(cause)));
        // What it said last holds until it says something else.
        if (guard.heard &&
            std::exchange(guard_was_disobeyed_, guard.disobeyed) != guard.disobeyed &&
            guard.disobeyed)
            annunciator_->announce(HornPattern::disobeyed,
                                   proto::text_of(proto::GuardCause::stop_disobeyed));
    }
    const auto annunciator = annunciator_->status();
    parts_.interlock.outside(!guard_lacks_.empty(), cause != proto::GuardCause::none,
                             annunciator.horn && !annunciator.confirms);
    show(tripped, alarm);
}

void Outside::show(bool tripped, bool alarm) {
    auto pattern = HornPattern::none;
    if (alarm) pattern = HornPattern::alarm;
    if (parts_.interlock.latched() || tripped) pattern = HornPattern::abort;
    if (parts_.rig.is_disobeyed()) pattern = HornPattern::disobeyed;
    if (guard_link_ && guard_link_->heard()) {
        const auto guard = guard_link_->word();
        if (guard.disobeyed && !guard.rest) pattern = HornPattern::disobeyed;
    }
    annunciator_->show(pattern);
}

}  // namespace vibrig
