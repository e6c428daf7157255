// The identity that the controller reports: the least urgent of all requests, at rest only.
#include <utility>

#include "drivers/shaker/modbus_shaker.hpp"

namespace vibrig::drivers {

ShakerIdentity ModbusShaker::identity() const {
    const std::lock_guard lock(identity_mutex_);
    return identity_;
}

/// Another device may be behind it, unless we have closed the link.
void ModbusShaker::link_is_new() {
    if (!std::exchange(closed_by_us_, false)) {
        asks_left_ = settings_.identify > 0 ? 2 : 0;
        const std::lock_guard lock(identity_mutex_);
        identity_.known = false;
    }
}

bool ModbusShaker::identity_due() const noexcept {
    return asks_left_ > 0 && polled_ && !commanded_ && !orders_.waiting() &&
           latest_.read().at_rest();
}

/// A late reply would be taken for the next one: a device that does not answer, or hangs up, costs
/// its link. Asked twice, it reports nothing.
void ModbusShaker::ask_identity() {
    std::string text;
    link_.respond_within(settings_.identify);
    const Reply reply = transact([&] { return link_.identify(text); });
    link_.respond_within(settings_.response_timeout);
    if (reply.kind == ReplyKind::overtaken || outranked()) return;  // a stop: asked after it
    --asks_left_;
    if (!link_.connected()) {
        closed_by_us_ = true;
        next_attempt_ = clock_.now();
        if (asks_left_ > 0) return;
    }
    asks_left_ = 0;
    const std::lock_guard lock(identity_mutex_);
    identity_ = {true, reply.ok() ? text : std::string()};
}

}  // namespace vibrig::drivers
