// The campaign's stages with the table at rest: waiting, zeroing and levelling.
#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/gravity_watch.hpp"
#include "daemon/campaign/levelling_stage.hpp"
#include "daemon/campaign/loop_check.hpp"
#include "daemon/campaign/zeroing_stage.hpp"
#include "estimator/levelling/design.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;
using State = CampaignState;

namespace {

constexpr Time kStagePoll = 200 * drivers::kMillisecond;
// Blocks and increments come ten and a hundred times a second.
constexpr Time kSilence = kSecond;
// From the zero command to the platform's word that nothing is torqued.
constexpr Time kZeroTimeout = 2 * kSecond;
// A status older than this is no status.
constexpr Time kPlatformDeadline = kSecond;

bool platform_is_silent(const drivers::PlatformStatus& platform, Time now) {
    return platform.time == 0 || now - platform.time > kPlatformDeadline;
}

}  // namespace

std::string check_stages(const Settings& settings, const proto::Dbc& dbc, drivers::CanPort& port) {
    if (!settings.levelling && !settings.zeroing) return {};
    try {
        double limit = settings.level.torquer_limit_deg_h;
        if (settings.levelling) {
            const drivers::Torquer torquer(dbc, settings.level.torquer, port);
            limit = torquer.limit();
            const LevellingStage stage(settings.level, settings.rig, settings.sample_s, limit);
            if (auto why = stage.refusal(); !why.empty()) return why;
        }
        if (settings.zeroing) {
            const ZeroingStage stage(settings.zero, settings.rig, settings.sample_s);
            if (auto why = stage.refusal(); !why.empty()) return why;
        }
        const rt::StageFeed feed(dbc, stage_feed_settings(settings), nullptr);
        const auto& level = settings.level;
        if (settings.levelling && level.velocity_north.empty() != (level.velocity_noise_mps == 0))
            return fmt::format(
                "levelling.velocity_noise_mps: found {:g}, expected {}", level.velocity_noise_mps,
                level.velocity_north.empty()
                    ? "0: levelling.velocity_north and velocity_east are not configured"
                    : "above 0: no reading of the base's velocity is exact");
    } catch (const estimator::levelling::DesignError& error) {
        return std::string("levelling: ") + error.what();
    } catch (const estimator::zeros::ZeroError& error) {
        return std::string("zeroing: ") + error.what();
    }
    return {};
}

StageTimes stage_times(const Settings& settings) {
    StageTimes times;
    if (settings.levelling) {
        const LevellingStage stage(settings.level, settings.rig, settings.sample_s,
                                   settings.level.torquer_limit_deg_h);
        times.levelling_s = stage.expected_s();
    }
    if (settings.zeroing) {
        // The gimbals go half a turn at most to where each way begins, and are levelled there.
        const double before_s = 180 / settings.zero.slew_deg_per_s + times.levelling_s;
        times.closing_s =
            ZeroingStage(settings.zero, settings.rig, settings.sample_s).expected_s() +
            static_cast<double>(ways_of(settings.zero).size()) * before_s;
    }
    return times;
}

rt::StageFeedSettings stage_feed_settings(const Settings& settings) {
    rt::StageFeedSettings feed;
    feed.increments = settings.zeroing;
    feed.gyro_message = settings.zero.gyro_message;
    feed.accelerometer_message = settings.zero.accelerometer_message;
    feed.block = settings.level.block;
    if (settings.levelling)
        feed.velocity = {settings.level.velocity_north, settings.level.velocity_east};
    return feed;
}

void Campaign::make_stages() {
    times_ = stage_times(settings_);
    gravity_ = std::make_shared<GravityWatch>(
        settings_.rig, GravityLimits{.refused_deg = settings_.gravity_refused_deg});
    loop_ = std::make_shared<LoopCheck>(settings_.loop, settings_.rig);
    if (settings_.levelling && ports_.rig.torquer != nullptr && ports_.rig.feed != nullptr) {
        level_ = std::make_shared<LevellingStage>(settings_.level, settings_.rig,
                                                  settings_.sample_s, ports_.rig.torquer->limit());
    }
    if (settings_.zeroing && ports_.rig.feed != nullptr)
        zero_ = std::make_shared<ZeroingStage>(settings_.zero, settings_.rig, settings_.sample_s);
    make_opening();
}

std::string Campaign::platform_lacks(Time now) const {
    const auto platform = ports_.rig.platform();
    if (platform_is_silent(platform, now)) return "no platform status on the bus";
    if (platform.fault) return "platform fault";
    if (!platform.ready || !platform.gyros_at_speed) return "platform not ready";
    if (!platform.loop_closed) return "stabilisation loop open";
    return {};
}

Time Campaign::wait_for_platform(Time now) {
    const auto platform = ports_.rig.platform();
    if (temperatures_.empty() || platform.time > temperatures_.back().first) {
        if (platform.time > 0) temperatures_.emplace_back(platform.time, platform.temperature_c);
    }
    const Time window = from_seconds(settings_.temperature_window_s);
    while (temperatures_.size() > 2 && temperatures_[1].first <= now - window)
        temperatures_.pop_front();
    bool steady = false;
    if (!temperatures_.empty() && temperatures_.front().first <= now - window) {
        const auto [low, high] =
            std::ranges::minmax(temperatures_, {}, &std::pair<Time, double>::second);
        steady = high.second - low.second <= settings_.temperature_band_c;
    }
    reason_ = platform_lacks(now);
    if (platform_is_silent(platform, now)) temperatures_.clear();
    if (reason_.empty() && !steady) reason_ = "temperature not steady";
    if (reason_.empty()) {
        start_position(now);
        return now;
    }
    if (now - entered_ > from_seconds(settings_.ready_timeout_s)) {
        abort(fmt::format("{} after {:g} s", reason_, settings_.ready_timeout_s), now);
    }
    return now + kSecond;
}

bool Campaign::take_motion(rt::Motion& motion, Time now) {
    if (!ports_.rig.feed->pop(motion)) return false;
    last_motion_ = now;
    return true;
}

bool Campaign::torquing() const {
    return ports_.rig.feed != nullptr && ports_.rig.feed->knows_torque() &&
           ports_.rig.feed->torque().torquing;
}

void Campaign::leave_stage() {
    if (ports_.rig.feed != nullptr) ports_.rig.feed->order(rt::StageFeed::Mode::off);
    if (ports_.rig.torquer != nullptr && !ports_.rig.torquer->zero())
        static_cast<void>(ports_.rig.torquer->command({}));
}

void Campaign::insist_on_zero_torque(Time now) {
    if (ports_.rig.torquer == nullptr || state_ == State::levelling) return;
    if (ports_.rig.torquer->zero() && !(active() && torquing())) return;
    if (now - torque_sent_ < kStagePoll) return;
    torque_sent_ = now;
    static_cast<void>(ports_.rig.torquer->command({}));
}

void Campaign::begin_zeroing(bool at_end, Time now) {
    zeroing_ = at_end ? Zeroing::end : Zeroing::start;
    part_ = Part::go;
    zero_->begin();
    ports_.log.event(Severity::info,
                     at_end ? "accelerometer zeros again" : "accelerometer zeros by azimuth slews");
    enter(State::zeroing, now);
}

Time Campaign::zeroing(Time now) {
    if (!ports_.rig.shaker.reading().at_rest()) {
        abort("the shaker left rest while the accelerometer zeros were taken", now);
        return now;
    }
    if (part_ == Part::go) {
        ports_.rig.gimbal.slew_to(zero_->target_deg(), now);
        part_ = Part::slew;
    }
    const auto gimbal = ports_.rig.gimbal.update(ports_.rig.platform(), now);
    if (gimbal == drivers::GimbalState::timed_out || gimbal == drivers::GimbalState::no_status) {
        return fail_zeroing(fmt::format("gimbals: {}", drivers::name_of(gimbal)), now);
    }
    const bool there = gimbal == drivers::GimbalState::in_position;
    if (part_ == Part::slew && there && level_ && !zero_->levelled()) {
        ports_.rig.gimbal.release(now);
        part_ = Part::go;
        enter(State::levelling, now);
    } else if (part_ == Part::slew && there) {
        ports_.rig.feed->order(rt::StageFeed::Mode::increments);
        last_motion_ = now;
        zero_->arrived();
        ports_.rig.gimbal.slew_to(zero_->target_deg(), now, true);
        part_ = Part::measure;
    } else if (part_ == Part::measure) {
        rt::Motion motion;
        while (!zero_->over() && take_motion(motion, now)) zero_->add(motion);
        if (zero_->over()) return end_zeroing(now);
        if (now - last_motion_ > kSilence) {
            return fail_zeroing("no increments of gyros and accelerometers on the bus for 1 s",
                                now);
        }
        if (there) {
            zero_->arrived();
            ports_.rig.gimbal.slew_to(zero_->target_deg(), now, true);
        }
    }
    return std::min(ports_.rig.gimbal.next_deadline(), now + kStagePoll);
}

Time Campaign::end_zeroing(Time now) {
    if (zero_->another()) {
        ports_.rig.feed->order(rt::StageFeed::Mode::off);
        zero_->begin_other_way();
        part_ = Part::go;
        return now;
    }
    leave_stage();
    if (const auto failure = zero_->finish(zeroing_ == Zeroing::end); !failure.empty())
        return fail_zeroing(failure, now);
    ports_.log.event(Severity::info, zero_->words());
    if (zeroing_ == Zeroing::end) {
        mark_ = zero_->status().mark;
        leave_zeroing(now);
    } else {
        zeroing_ = Zeroing::none;
        zeroed_ = true;
        start_position(now);
    }
    return now;
}

Time Campaign::fail_zeroing(const std::string& why, Time now) {
    if (zeroing_ == Zeroing::end) {
        // The dwells are done: the campaign stands, but nobody can say that the zeros stayed.
        mark_ = "zeros not confirmed at the end: " + why;
        leave_zeroing(now);
    } else {
        abort("zeroing: " + why, now);
    }
    return now;
}

void Campaign::leave_zeroing(Time now) {
    zeroing_ = Zeroing::none;
    leave_stage();
    ports_.rig.gimbal.release(now);
    if (!mark_.empty()) ports_.log.event(Severity::alarm, "campaign marked: " + mark_);
    finish(now);
}

Time Campaign::fail_levelling(const std::string& why, Time now) {
    leave_stage();
    if (for_zeroing()) return fail_zeroing("levelling: " + why, now);
    abort("levelling: " + why, now);
    return now;
}

Time Campaign::levelling(Time now) {
    if (!ports_.rig.shaker.reading().at_rest()) {
        abort("the shaker left rest while the platform was levelled", now);
        return now;
    }
    const auto gimbal = ports_.rig.gimbal.update(ports_.rig.platform(), now);
    if (part_ == Part::go) {
        if (gimbal == drivers::GimbalState::commanding)
            return std::min(ports_.rig.gimbal.next_deadline(), now + kStagePoll);
        if (gimbal != drivers::GimbalState::idle) {
            return fail_levelling(fmt::format("gimbals not released: {}", drivers::name_of(gimbal)),
                                  now);
        }
        level_->begin(for_zeroing() ? zero_->target_deg() : here().stop.position_deg,
                      zero_ ? zero_->status() : ZeroStatus{});
        ports_.rig.feed->order(rt::StageFeed::Mode::force);
        last_motion_ = now;
        part_ = Part::measure;
    }
    if (part_ == Part::measure) {
        rt::Motion motion;
        std::array<double, 3> rate{};
        bool any = false;
        while (!level_->done() && level_->failure().empty() && take_motion(motion, now)) {
            rate = level_->step(motion);
            level_angle_rad_ = motion.angle;
            any = true;
        }
        if (const auto why = level_->failure(); !why.empty()) return fail_levelling(why, now);
        if (level_->done()) {
            leave_stage();
            ports_.log.event(Severity::info, level_->words());
            if (!for_zeroing()) {
                auto drift = level_->drift(level_angle_rad_);
                drift.run = here().run;
                drift.position = here().position;
                ports_.dwells.levelled(drift);
            }
            part_ = Part::zero;
            torque_sent_ = zero_since_ = now;
            return now + kStagePoll;
        }
        if (any) static_cast<void>(ports_.rig.torquer->command(rate));
        if (now - last_motion_ > kSilence)
            return fail_levelling("no specific force on the bus for 1 s", now);
        return now + kStagePoll;
    }
    // A dwell is free drift: it begins only when the platform itself says that nothing is torqued.
    const auto torque = ports_.rig.feed->torque();
    const bool confirmed =
        !ports_.rig.feed->knows_torque() || (torque.time > zero_since_ && !torque.torquing &&
                                             torque.echo == ports_.rig.torquer->counter());
    if (ports_.rig.torquer->zero() && confirmed) {
        if (for_zeroing()) zero_->levelled_at(level_angle_rad_);
        part_ = Part::go;
        enter(for_zeroing() ? State::zeroing : State::ramping, now);
        return now;
    }
    if (now - zero_since_ > kZeroTimeout) {
        return fail_levelling(
            "torquing commanded to zero, not confirmed by the platform within 2 s", now);
    }
    if (now - torque_sent_ >= kStagePoll) {
        torque_sent_ = now;
        static_cast<void>(ports_.rig.torquer->command({}));
    }
    return now + kStagePoll / 2;
}

}  // namespace vibrig::campaign
