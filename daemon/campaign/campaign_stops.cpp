// Which stops there are, one after the other, and how an interrupted campaign goes on.
#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/stages/dwelling.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;

namespace {

// A flagged dwell of an adaptive campaign is repeated so often at most.
constexpr int kMostRepeats = 2;
/// An interruption after which a dwell of before is repeated: it ties both halves.
constexpr Time kLongInterruption = 3600 * drivers::kSecond;

bool same(const Stop& a, const Stop& b) {
    return a.position_deg == b.position_deg && a.table_g == b.table_g && a.kind() == b.kind() &&
           a.verify == b.verify;
}

}  // namespace

void Campaign::add_stop(const Stop& stop) {
    const std::pair one{stop.table_g, stop.kind()};
    const auto level = std::ranges::find(levels_, one);
    const auto run = level - levels_.begin();
    if (level == levels_.end()) levels_.push_back(one);
    stops_.push_back({stop, static_cast<int>(run) + 1, static_cast<int>(stops_.size()) + 1});
}

void Campaign::plan_stops() {
    stops_.clear();
    levels_.clear();
    at_ = 0;
    repeats_ = 0;
    used_before_s_ = 0;
    for (const Stop& stop : settings_.stops) add_stop(stop);
    for (const StopDone& done : settings_.adaptive ? offered_stops_ : std::vector<StopDone>{}) {
        add_stop({done.position_deg, done.table_g});
        repeats_ = done.repeats;
        used_before_s_ = done.used_s;
    }
    if (listed()) {
        const std::size_t positions = settings_.positions_deg.size();
        const std::size_t all = settings_.table_g.size() * positions;
        const bool ordered = settings_.sequence.size() == all;
        for (std::size_t i = 0; i < all; ++i) {
            const std::size_t at = ordered ? settings_.sequence[i] : i;
            const std::size_t run = at / positions, k = at % positions;
            stops_.push_back({{settings_.positions_deg[k], settings_.table_g[run]},
                              static_cast<int>(run) + 1,
                              static_cast<int>(k) + 1});
        }
    }
    expected_ = planned_ = stops_.size();
}

/// An interrupted campaign goes on with what is left, in whatever order the first stops were: that
/// of an earlier version, too. A stop that was repeated is there as often. False: it did others.
bool Campaign::put_first(const std::vector<estimator::DwellSummary>& done) {
    for (std::size_t i = 0; i < done.size(); ++i) {
        const auto from = stops_.begin() + static_cast<std::ptrdiff_t>(i);
        const NumberedStop again{{}, done[i].run, done[i].position};
        if (is_repeat(again) && offered_stops_.size() == done.size()) {
            const auto of = std::find_if(stops_.begin(), from, [&](const NumberedStop& stop) {
                const StopDone& offered = offered_stops_[i];
                const Stop& mine = stop.stop;
                return mine.position_deg == offered.position_deg &&
                       mine.table_g == offered.table_g && mine.kind() == offered.kind() &&
                       mine.verify == offered.held_out;
            });
            if (of == from) return false;
            stops_.insert(from, {of->stop, again.run, again.position});
            continue;
        }
        const auto at = std::find_if(from, stops_.end(), [&](const NumberedStop& stop) {
            return stop.run == done[i].run && stop.position == done[i].position;
        });
        if (at == stops_.end() || (at != from && !listed())) return false;
        std::rotate(from, at, at + 1);
    }
    expected_ = stops_.size();
    return true;
}

bool Campaign::repeat_stop(std::size_t of, const std::string& why) {
    const NumberedStop stop = stops_[of];
    const bool before = std::ranges::any_of(stops_, [&](const NumberedStop& other) {
        return is_repeat(other) && same(other.stop, stop.stop);
    });
    if (before) return false;
    const int number = static_cast<int>(stops_.size()) + 1;
    stops_.insert(stops_.begin() + static_cast<std::ptrdiff_t>(at_), {stop.stop, stop.run, number});
    expected_ = stops_.size();
    ports_.log.event(Severity::warning,
                     fmt::format("run {} position {} is repeated, as position {}: {}", stop.run,
                                 stop.position, number, why));
    return true;
}

void Campaign::repeat_doubted() {
    if (!doubted_ || settings_.on_not_valid != OnNotValid::repeat) return;
    const Doubt doubt = *std::exchange(doubted_, std::nullopt);
    const auto named = std::ranges::find_if(stops_, [&](const NumberedStop& stop) {
        return stop.run == doubt.run && stop.position == doubt.position;
    });
    if (named - stops_.begin() >= static_cast<std::ptrdiff_t>(at_)) {
        ports_.log.event(Severity::warning,
                         "it goes on, there is no dwell to repeat: " + doubt.why);
    } else if (!repeat_stop(static_cast<std::size_t>(named - stops_.begin()), doubt.why)) {
        ports_.log.event(Severity::warning,
                         fmt::format("it goes on, run {} position {} was repeated before: {}",
                                     doubt.run, doubt.position, doubt.why));
    }
}

void Campaign::repeat_after_interruption() {
    if (settings_.adaptive || !offered_last_ || offered_last_->begun_utc_ns <= 0 || at_ == 0 ||
        at_ >= stops_.size())
        return;
    const Time since = utc_ns() - offered_last_->begun_utc_ns;
    if (since <= kLongInterruption + drivers::from_seconds(settings_.dwell_s)) return;
    static_cast<void>(
        repeat_stop(at_ - 1, fmt::format("{:.1f} h without a dwell, which it ties together",
                                         drivers::to_seconds(since) / 3600)));
}

Campaign::Choice Campaign::choose_next(Time now) {
    if (!settings_.adaptive) return at_ < stops_.size() ? Choice::more : Choice::end;
    const bool begun = at_ > 0;
    const bool in_time =
        settings_.time_limit_s <= 0 ||
        used_s(now) + nominal_stop_s() + times_.closing_s <= settings_.time_limit_s;
    const bool poor = begun && dwells_.back().flagged && !dwells_.back().followed;
    if (poor && repeats_ < kMostRepeats && in_time) {
        ++repeats_;
        const Stop again = stops_[at_ - 1].stop;
        ports_.log.event(Severity::warning, "flagged dwell: the position is repeated");
        add_stop(again);
        expected_ = std::max(expected_, stops_.size());
        return Choice::more;
    }
    const auto here = begun ? stops_[at_ - 1].stop.position_deg : std::array<double, 3>{};
    const auto next = ports_.dwells.next(here, used_s(now));
    if (!next) return Choice::thinking;
    repeats_ = 0;
    ports_.log.event(Severity::info, next->words);
    if (!next->more) {
        expected_ = stops_.size();
        return Choice::end;
    }
    add_stop(next->stop);
    expected_ = at_ + next->left;
    return Choice::more;
}
CommandReply Campaign::resume_interrupted(const CommandRequest& request, Time now) {
    if (state_ != State::armed) return {false, "not armed: a named person arms it first"};
    if (const auto why = not_fit_to_excite(now); !why.empty()) return {false, why};
    if (!ports_.dwells.free()) return {false, "the last dwell is still being closed"};
    if (const auto why = ports_.dwells.resume_gate(); !why.empty())
        return {false, "not consistent with the campaign so far: " + why};
    const std::string what = resume_offer();
    ports_.dwells.resume(request.by);
    begin(request.by, now);
    const std::string text =
        "campaign resumed: " + what + (started_by_ == armed_by_ ? "" : ", armed by " + armed_by_);
    ports_.log.event(Severity::info, fmt::format("{} by {}", text, request.by));
    return {true, text};
}

std::string Campaign::resume_offer() const {
    if (offer_.empty()) return {};
    if (settings_.adaptive) return fmt::format("{} positions done", offer_.size());
    return fmt::format("{} of {} positions done", offer_.size(), stops_.size());
}

/// Gyros run down when they lose their power, between two dwells or while the daemon is away: what
/// the bias does then no walk tells.
void Campaign::watch_power() {
    const auto platform = ports_.rig.platform();
    if (platform.time > 0 && !platform.gyros_at_speed) dwelling_->lost_power();
}

bool Campaign::offer(std::vector<estimator::DwellSummary> done, std::vector<StopDone> stops) {
    offered_last_.reset();
    if (!stops.empty()) offered_last_ = stops.back();
    offered_stops_ = std::move(stops);
    if (settings_.adaptive) plan_stops();
    const bool fits = put_first(done);
    if (fits) {
        offer_ = std::move(done);
    } else {
        offered_stops_.clear();
        offered_last_.reset();
        plan_stops();
    }
    return fits;
}
}  // namespace vibrig::campaign
