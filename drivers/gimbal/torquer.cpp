#include "drivers/gimbal/torquer.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <string_view>

#include "drivers/sample/signal_binding.hpp"

namespace vibrig::drivers {

Torquer::Torquer(const proto::Dbc& dbc, const TorquerSettings& settings, CanPort& port)
    : settings_(settings), port_(port) {
    const auto bind = [&](const char* signal, const char* unit = "") {
        const BoundSignal bound =
            bind_signal(dbc, "levelling.torque_message", settings_.message + "." + signal, unit);
        message_ = bound.message;
        return bound.signal;
    };
    rates_ = {bind("X", "deg/h"), bind("Y", "deg/h"), bind("Z", "deg/h")};
    counter_signal_ = bind("Counter");
    limit_ = HUGE_VAL;
    for (const proto::Signal* rate : rates_) {
        if (rate->minimum != rate->maximum)
            limit_ = std::min({limit_, std::abs(rate->minimum), std::abs(rate->maximum)});
    }
}

bool Torquer::known(const proto::Dbc& dbc, const TorquerSettings& settings) {
    const auto* message = dbc.find(std::string_view(settings.message));
    return message != nullptr && message->find("X") != nullptr && message->find("Y") != nullptr &&
           message->find("Z") != nullptr && message->find("Counter") != nullptr;
}

bool Torquer::command(const std::array<double, 3>& deg_per_h) noexcept {
    canfd_frame frame{};
    frame.can_id = message_->id | (message_->extended ? CAN_EFF_FLAG : 0);
    frame.len = message_->size;
    const std::span<std::uint8_t> payload(frame.data, frame.len);
    bool good = proto::encode_raw(*counter_signal_, ++counter_, payload);
    const bool zero = deg_per_h == std::array<double, 3>{};
    if (zero) rest_ = {};
    for (std::size_t i = 0; i < rates_.size(); ++i) {
        const double rate =
            std::clamp(settings_.sign[i] * deg_per_h[i] + rest_[i], -limit_, limit_);
        good = good && std::isfinite(rate) && proto::encode(*rates_[i], rate, payload);
        if (good && !zero) rest_[i] = rate - proto::decode(*rates_[i], payload).value_or(rate);
    }
    if (!good) return false;
    // Until a zero has gone out, what the torquers do is not known to be nothing.
    const bool sent = port_.send(frame, message_->size > CAN_MAX_DLEN);
    zero_ = zero && sent;
    return sent;
}

}  // namespace vibrig::drivers
