// What the table is told, and what is held against encoders and dwells before it is told to move.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/gravity_watch.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/zeroing_stage.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {
// A position that does not show a still second in this time does not stand.
constexpr Time kStillTimeout = 10 * kSecond;
}  // namespace

void Campaign::watch_gravity() {
    if (!ports_.second || !active() || state_ == State::slewing || state_ == State::zeroing) return;
    const rt::MeanMotion second = ports_.second();
    // What began before the state may still be of a slew.
    if (second.from == second_from_ || !second.good || second.from < entered_) return;
    second_from_ = second.from;
    if (state_ == State::ramping && !requested_) gravity_->next_position();
    Vector zero_g = settings_.rig.accelerometer_zero_g;
    if (zero_ && zero_->status().known) {  // on top of the configuration's
        const Vector found = zero_->raw_zero_g();
        for (std::size_t i = 0; i < 3; ++i) zero_g[i] += found[i];
    }
    const auto verdict = gravity_->judge(second, zero_g, !stop_.excited());
    if (std::exchange(gravity_told_, verdict.told) == verdict.told) return;
    ports_.event(verdict.told ? Severity::alarm : Severity::info,
                 verdict.told ? gravity_->words() : "gravity is where the encoders say again");
}

bool Campaign::gravity_holds(Time now) {
    if (!ports_.second) return true;
    if (second_from_ < entered_) {
        if (now - entered_ > kStillTimeout)
            pause_at_rest("no still second before the ramp: force or angles are missing or move",
                          now);
        return false;
    }
    if (!gravity_->newest().refused) return true;
    const auto suspects = gravity_->suspects();
    pause_at_rest(gravity_->words() + (suspects.empty() ? "" : "; " + suspects), now);
    return false;
}

bool Campaign::too_many_rejected(Time now) {
    if (rejected_in_a_row_ < settings_.rejected_in_a_row) return false;
    const auto suspects = gravity_->suspects();
    pause_at_rest(fmt::format("{} dwells in a row rejected, the last: {}{}",
                              std::exchange(rejected_in_a_row_, 0), rejected_for_,
                              gravity_->newest().told && !suspects.empty() ? "; " + suspects : ""),
                  now);
    return true;
}

bool Campaign::not_valid_so_far(Time now) {
    if (doubted_.empty() || !settings_.pause_when_not_valid) return false;
    pause_at_rest("the dwells so far: " + std::exchange(doubted_, {}), now);
    return true;
}

void Campaign::pause_at_rest(const std::string& why, Time now) {
    pause_asked_ = true;
    enter(State::paused, now);
    reason_ = why;
    ports_.event(Severity::alarm, "paused at rest, resume when it is put right: " + why);
}

}  // namespace vibrig::campaign
