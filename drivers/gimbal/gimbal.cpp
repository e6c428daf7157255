#include "drivers/gimbal/gimbal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>

#include "drivers/sample/assembler.hpp"
#include "drivers/sample/signal_binding.hpp"
#include "proto/word_of.hpp"

namespace vibrig::drivers {

const char* name_of(GimbalState state) noexcept {
    static constexpr std::array kWords{"idle",        "commanding", "slewing",
                                       "in_position", "timed_out",  "no_status"};
    return proto::word_of(kWords, state);
}

Gimbal::Gimbal(const proto::Dbc& dbc, const GimbalSettings& settings, CanPort& port)
    : message_(nullptr), settings_(settings), port_(port) {
    const auto bind = [&](const char* signal, const char* unit = "") {
        const BoundSignal bound =
            bind_signal(dbc, "can.signals.gimbal_command", settings_.message + "." + signal, unit);
        message_ = bound.message;
        return bound.signal;
    };
    angles_ = {bind("Outer", "deg"), bind("Inner", "deg"), bind("Azimuth", "deg")};
    mode_signal_ = bind("Mode");
    counter_signal_ = bind("Counter");
}

void Gimbal::slew_to(const std::array<double, 3>& position_deg, Time now,
                     bool increments) noexcept {
    // Well below half a turn there is one shorter way, and it is the direct one.
    constexpr double kOneWay = 170;
    target_deg_ = position_deg;
    beyond_deg_.reset();
    for (std::size_t i = 0; i < 3; ++i) {
        const auto& travel = settings_.travel_deg[i];
        if (travel[1] - travel[0] >= 360) continue;
        const auto angle = within_travel(position_deg[i], travel);
        if (!angle) {
            target_deg_[i] = HUGE_VAL;
            break;
        }
        const auto here = here_deg_ ? within_travel((*here_deg_)[i], travel) : std::nullopt;
        if (here && std::abs(*angle - *here) < kOneWay) continue;
        beyond_deg_ = position_deg;
        target_deg_[i] = 0.5 * (travel[0] + travel[1]);
    }
    here_deg_.reset();
    command(increments && !beyond_deg_ ? Mode::slew_with_increments : Mode::slew, now);
    after_ = increments ? Mode::slew_with_increments : Mode::slew;
}

void Gimbal::next_leg(Time now) noexcept {
    target_deg_ = *beyond_deg_;
    beyond_deg_.reset();
    command(after_, now);
}

void Gimbal::release(Time now) noexcept {
    beyond_deg_.reset();
    command(Mode::free_drift, now);
}

void Gimbal::command(Mode mode, Time now) noexcept {
    mode_ = mode;
    ++counter_;
    commanded_ = true;
    echoed_ = false;
    arrived_ = false;
    commanded_at_ = now;
    state_ = GimbalState::commanding;
    send(now);
}

double Gimbal::representable(const proto::Signal& signal, double degrees) noexcept {
    const double turn = std::remainder(degrees, 360.0);  // [-180, 180]
    std::array<std::uint8_t, CANFD_MAX_DLEN> scratch{};
    for (const double candidate : {turn, turn + 360.0, turn - 360.0}) {
        if (proto::out_of_range(signal, candidate) || !proto::encode(signal, candidate, scratch))
            continue;
        const double back = proto::decode(signal, scratch)
                                .value_or(HUGE_VAL);  // encode clamps to what the bits hold
        if (std::abs(back - candidate) <= std::abs(signal.scale)) return candidate;
    }
    return turn;
}

void Gimbal::send(Time now) noexcept {
    sent_at_ = now;
    canfd_frame frame{};
    frame.can_id = message_->id | (message_->extended ? CAN_EFF_FLAG : 0);
    frame.len = message_->size;
    const std::span<std::uint8_t> payload(frame.data, frame.len);
    bool good = proto::encode_raw(*mode_signal_, static_cast<std::uint64_t>(mode_), payload) &&
                proto::encode_raw(*counter_signal_, counter_, payload);
    for (std::size_t i = 0; i < angles_.size(); ++i) {
        good =
            good && proto::encode(*angles_[i], representable(*angles_[i], target_deg_[i]), payload);
    }
    // A target that cannot be encoded (not finite) is not sent; the slew then times out. A frame
    // the port refuses is counted there and sent again after `repeat`.
    if (good) static_cast<void>(port_.send(frame, message_->size > CAN_MAX_DLEN));
}

GimbalState Gimbal::update(const PlatformStatus& status, Time now) noexcept {
    state_ = follow(status, now);
    if (state_ != GimbalState::in_position || mode_ == Mode::free_drift) return state_;
    if (beyond_deg_) {
        next_leg(now);
    } else {
        here_deg_ = target_deg_;
    }
    return state_;
}

GimbalState Gimbal::follow(const PlatformStatus& status, Time now) noexcept {
    status_at_ = status.gimbal_time;
    if (!commanded_) {
        // The platform remembers the counter of whoever commanded it last: ours starts where that
        // one ended.
        counter_ = status.gimbal_command_echo;
        return GimbalState::idle;
    }
    if (state_ == GimbalState::timed_out) return state_;
    const bool believed =
        status.gimbal_time > 0 && now - status.gimbal_time <= settings_.status_deadline;
    // Only a status from after the command can be an answer to it.
    if (believed && status.gimbal_time > commanded_at_ && status.gimbal_command_echo == counter_)
        echoed_ = true;

    const bool released = echoed_ && mode_ == Mode::free_drift;
    const bool there = echoed_ && believed && status.in_position && !status.slewing;
    arrived_ = arrived_ || there;
    if (!released && !arrived_ && now - commanded_at_ >= settings_.slew_timeout) {
        return GimbalState::timed_out;
    }
    if (!echoed_ && now - sent_at_ >= settings_.repeat) send(now);
    if (released) return GimbalState::idle;
    if (!believed) return GimbalState::no_status;
    if (!echoed_) return GimbalState::commanding;
    return there ? GimbalState::in_position : GimbalState::slewing;
}

Drift Gimbal::drift(const PlatformStatus& status, Time now) const noexcept {
    if (!commanded_ || !echoed_ || mode_ != Mode::free_drift) return Drift::free;
    if (now - status.gimbal_time > settings_.status_deadline) return Drift::silent;
    if (status.gimbal_command_echo != counter_) return Drift::led;
    return status.slewing ? Drift::slews : Drift::free;
}

Time Gimbal::next_deadline() const noexcept {
    if (!commanded_ || state_ == GimbalState::timed_out || state_ == GimbalState::idle)
        return kNever;
    Time deadline = kNever;
    if (!echoed_) deadline = std::min(deadline, sent_at_ + settings_.repeat);
    if (!arrived_) deadline = std::min(deadline, commanded_at_ + settings_.slew_timeout);
    if (state_ != GimbalState::no_status && status_at_ > 0) {
        deadline = std::min(deadline, status_at_ + settings_.status_deadline + 1);
    }
    return deadline;
}

}  // namespace vibrig::drivers
