// What is commanded, and what is held against encoders and dwells before the table may move.
#include <spdlog/fmt/fmt.h>

#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/gravity_watch.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/stages/zeroing.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {
// A position that does not show a still second in this time does not stand.
constexpr Time kStillTimeout = 10 * kSecond;
// One reading that is wild turns the direction of the vibration in its second, not in two.
constexpr Time kVibrationOff = 2 * kSecond;
}  // namespace

void Campaign::watch_gravity() {
    const auto newest = ports_.rig.second();
    if (!newest || !active() || state_ == State::slewing || state_ == State::zeroing || opening())
        return;
    const rt::MeanMotion& second = *newest;
    // What began before the state may still be of a slew.
    if (second.from == second_from_ || second.from < entered_) return;
    if (!second.good) {
        vibration_off_since_ = -1;
        return;
    }
    second_from_ = second.from;
    if (state_ == State::ramping && !excitation_.asked()) gravity_->next_position();
    Vector zero_g = settings_.rig.accelerometer_zero_g;
    if (zeros() != nullptr && zeros()->status().known) {  // on top of the configuration's
        const Vector found = zeros()->raw_zero_g();
        for (std::size_t i = 0; i < 3; ++i) zero_g[i] += found[i];
    }
    const auto verdict = gravity_->judge(second, zero_g, !stop_.excited());
    if (!verdict.vibration_off) {
        vibration_off_since_ = -1;
    } else if (vibration_off_since_ < 0) {
        vibration_off_since_ = second.from;
    } else if (second.to - vibration_off_since_ >= kVibrationOff) {
        const bool first = vibration_off_.empty();
        vibration_off_ = gravity_->vibration_words();
        if (first) ports_.log.event(Severity::alarm, vibration_off_);
    }
    if (std::exchange(gravity_warned_, verdict.warned) == verdict.warned) return;
    ports_.log.event(
        verdict.warned ? Severity::alarm : Severity::info,
        verdict.warned ? gravity_->words() : "gravity is where the encoders say again");
}

bool Campaign::vibration_was_off(Time now) {
    if (vibration_off_.empty()) return false;
    pause_at_rest(std::exchange(vibration_off_, {}), now);
    return true;
}

bool Campaign::gravity_holds(Time now) {
    if (!ports_.rig.second()) return true;
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
    pause_at_rest(
        fmt::format("{} dwells in a row rejected, the last: {}{}",
                    std::exchange(rejected_in_a_row_, 0), rejected_for_,
                    gravity_->newest().warned && !suspects.empty() ? "; " + suspects : ""),
        now);
    return true;
}

bool Campaign::not_valid_so_far(Time now) {
    if (!doubted_ || settings_.on_not_valid != OnNotValid::pause) return false;
    pause_at_rest("the dwells so far: " + doubted_->why, now);
    doubted_.reset();
    return true;
}

void Campaign::pause_at_rest(const std::string& why, Time now) {
    pause_asked_ = true;
    stage_ = nullptr;
    enter(State::paused, now);
    reason_ = why;
    ports_.log.event(Severity::alarm, "paused at rest, resume when it is put right: " + why);
}

}  // namespace vibrig::campaign
