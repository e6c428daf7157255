#include "daemon/guard/judge.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::guard {

using proto::GuardCause;

namespace {

// A daemon that was there before the guard finds it within this time, s.
constexpr double kFirstWord_s = 3;
constexpr double kForget_s = 5;
// Below this peak nothing is more than what was armed: noise, and hands.
constexpr double kLeastLevel_g = 0.15;
// Hands, slews and torquers move a platform, too: by more than this rms for so long none of them.
// The norm of the specific force hardly shows a slew: half a second at 30 deg/s is 0.08 g rms where
// an axis counts double.
constexpr double kShaken_g = 0.2;
constexpr double kShaken_s = 2;

bool moves_table(const ShakerWord& shaker) {
    return shaker.known && (shaker.runs || shaker.measured_g >= safety::kMoving_g);
}

}  // namespace

bool Judge::Held::for_s(bool condition, const Moment& now, double seconds) noexcept {
    if (!condition) {
        since_.reset();
        return false;
    }
    if (!since_) since_ = now;
    return seconds_between(*since_, now) >= seconds;
}

bool Judge::hangs(const Moment& now, const proto::DaemonWord& word) noexcept {
    bool hangs = false;
    for (std::size_t i = 0; i < progress_.size(); ++i) {
        if (word.progress[i] != progress_[i]) {
            progress_[i] = word.progress[i];
            progressed_[i] = now;
        } else if (progressed_[i].wall == 0) {
            progressed_[i] = now;
        }
        hangs = hangs || seconds_between(progressed_[i], now) > safety::kProgressDeadline_s;
    }
    return hangs;
}

/// An arming alone moves nothing: between two excitations gimbals and people move the platform, and
/// neither of them shakes it. What was excited last has its time to come to rest.
bool Judge::shakes_unexcited(const Evidence& e, const Moment& now, bool armed) noexcept {
    if (armed && e.word->excitation) excited_ = now;
    const double since = seconds_between(excited_.value_or(*started_), now);
    const bool unexcited = armed && !e.word->excitation && since > settings_.stop_deadline_s;
    const auto moves = [](const Motion& motion, double g) {
        return motion.known && motion.rest_g > g;
    };
    const bool table = moves_table(e.shaker) || moves(e.sight.table, safety::kMoving_g);
    const bool platform = since > settings_.stop_deadline_s + safety::kRingDown_s &&
                          moves(e.sight.platform, kShaken_g);
    const bool by_table = table_unexcited_.for_s(unexcited && table, now, safety::kUnarmedMotion_s);
    return platform_unexcited_.for_s(unexcited && platform, now, kShaken_s) || by_table;
}

GuardCause Judge::find(const Evidence& e, const Moment& now) noexcept {
    const bool silent = e.word ? drivers::to_seconds(e.now - e.heard) > safety::kHeartbeatDeadline_s
                               : drivers::to_seconds(e.now - started_->wall) > kFirstWord_s;
    // A daemon that died has armed nothing any more, once the table is seen to rest; rest of before
    // does not count.
    const bool quiet = quiet_.for_s(silent && rests_, now, kForget_s);
    forgotten_ = silent && (forgotten_ || quiet);
    const bool allowed = e.word && (e.word->armed || e.word->excitation) && !forgotten_;
    const bool hanging = e.word && hangs(now, *e.word) && !silent;
    if (allowed && !silent) allowed_ = now;
    const bool moving = moving_.for_s(moves_, now, safety::kUnarmedMotion_s);

    // With nobody at the wheel: at once what was armed and is not at rest, be it unseen.
    if ((silent || hanging) && (moving || (allowed && !rests_)))
        return silent ? GuardCause::daemon_silent : GuardCause::daemon_hangs;
    const bool in_grace = allowed_ && seconds_between(*allowed_, now) <= settings_.stop_deadline_s;
    if (e.word && !silent && !allowed && moving && !in_grace) return GuardCause::unarmed_motion;
    if (shakes_unexcited(e, now, allowed && !silent)) return GuardCause::unarmed_motion;
    const double level = e.word ? std::min(e.word->level_g, settings_.limit_g) : 0;
    const double most = std::max(level * std::pow(10.0, safety::kOverArmed_dB / 20), kLeastLevel_g);
    // The table shows what was armed; the platform may show more of a plan's other vibration.
    const double ratio = e.word ? std::min(e.word->platform_ratio, settings_.most_ratio) : 1;
    const double seen = e.word ? std::max(e.sight.table.peak_g, e.sight.by_platform_g / ratio) : 0;
    if (over_.for_s(allowed && e.sight.known() && seen > most, now, safety::kOverArmed_s))
        return GuardCause::over_level;
    return GuardCause::none;
}

void Judge::watch_stop(const Evidence& e, const Moment& now) noexcept {
    const bool ordered = cause_ != GuardCause::none || (e.word && e.word->stop_ordered);
    if (!ordered) {
        ordered_.reset();
        stop_matters_ = obeyed_ = false;
        return;
    }
    if (!ordered_) ordered_ = now;
    // A stop at rest, as at the daemon's start with the rig switched off, is nothing to wait for.
    stop_matters_ =
        stop_matters_ || moves_ || cause_ != GuardCause::none || (e.word && e.word->excitation);
    if (!stop_matters_) return;
    const double since = seconds_between(*ordered_, now);
    const bool table_rests = e.sight.table_rests(settings_.rest_g) && !moves_table(e.shaker);
    const bool late = !table_rests && since > settings_.stop_deadline_s;
    const bool ringing = !rests_ && since > settings_.stop_deadline_s + safety::kRingDown_s;
    obeyed_ = obeyed_ || rests_;
    if (rests_ || (obeyed_ && !moves_)) {
        // It was obeyed: what moves after this moves anew, and a rig that is switched off does not.
        ordered_ = now;
    } else if (late || ringing) {
        disobeyed_ = true;
        found(GuardCause::stop_disobeyed);
    }
}

void Judge::found(GuardCause cause) noexcept {
    if (cause_ != GuardCause::none) return;
    cause_ = cause;
    finding_ = next_finding_++;
}

void Judge::judge(const Evidence& e) noexcept {
    const Moment now{e.now, e.rig};
    if (!started_) started_ = now;
    const bool shaker_moves = moves_table(e.shaker);
    moves_ = e.sight.moves(safety::kMoving_g) || shaker_moves;
    rests_ = e.sight.rests(settings_.rest_g) && !shaker_moves;
    if (const GuardCause cause = find(e, now); cause != GuardCause::none) found(cause);
    watch_stop(e, now);
    if (cause_ != GuardCause::none && e.word && e.word->acknowledged == finding_) acknowledge();
    // By the guard's own read-back, and by the witnesses.
    stop_wanted_ = cause_ != GuardCause::none && !(rests_ && e.shaker.known && !e.shaker.runs);
}

bool Judge::acknowledge() noexcept {
    if (!rests_) return false;
    cause_ = GuardCause::none;
    disobeyed_ = false;
    stop_wanted_ = false;
    ordered_.reset();
    stop_matters_ = obeyed_ = false;
    return true;
}

Tune Judge::tune() const noexcept {
    if (cause_ == GuardCause::none) return Tune::none;
    return disobeyed_ && !rests_ ? Tune::disobeyed : Tune::stop;
}

}  // namespace vibrig::guard
