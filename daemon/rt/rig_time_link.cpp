#include "daemon/rt/rig_time_link.hpp"

#include <stdexcept>
#include <string>

namespace vibrig::rt {
namespace {

const proto::Message* message(const proto::Dbc& dbc, const char* name) {
    const auto* found = dbc.find(name);
    if (found == nullptr) throw std::logic_error(std::string("rig.dbc: no message ") + name);
    return found;
}

const proto::Signal* signal(const proto::Message* in, const char* name) {
    const auto* found = in->find(name);
    if (found == nullptr) throw std::logic_error("rig.dbc: no signal " + in->name + "." + name);
    return found;
}

}  // namespace

RigTimeLink::RigTimeLink(drivers::CanPort& port)
    : port_(port),
      dbc_(proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc")),
      tick_(message(dbc_, "RigTime")),
      tick_time_(signal(tick_, "TimeUs")),
      tick_end_(signal(tick_, "TickEnd")),
      ack_(message(dbc_, "RigAck")),
      ack_time_(signal(ack_, "TimeUs")) {}

bool RigTimeLink::is_time(const canfd_frame& frame) const noexcept {
    return frame.can_id == tick_->id;
}

std::optional<RigTimeLink::Tick> RigTimeLink::decode(const canfd_frame& frame) noexcept {
    if (!is_time(frame) || frame.len != tick_->size) return std::nullopt;
    const std::span<const std::uint8_t> payload(frame.data, frame.len);
    const auto time = proto::decode_raw(*tick_time_, payload);
    const auto end = proto::decode_raw(*tick_end_, payload);
    if (!time || !end) return std::nullopt;
    const std::int64_t us = *time;
    if (us > drivers::kNever / drivers::kMicrosecond / 2) return std::nullopt;
    const auto follows = [us](std::int64_t from) {
        return us >= from && us - from <= kLargestStepUs;
    };
    if (last_us_ >= 0 && !follows(last_us_)) {
        if (suspect_us_ < 0 || !follows(suspect_us_)) {
            suspect_us_ = us;
            return std::nullopt;
        }
        offset_us_ += last_us_ - suspect_us_;
    }
    suspect_us_ = -1;
    last_us_ = us;
    return Tick{(us + offset_us_) * drivers::kMicrosecond, *end != 0, us};
}

std::optional<canfd_frame> RigTimeLink::acknowledge(const Tick& tick) noexcept {
    canfd_frame frame{};
    frame.can_id = ack_->id;
    frame.len = ack_->size;
    if (!proto::encode_raw(*ack_time_, static_cast<std::uint64_t>(tick.rig_us),
                           {frame.data, frame.len}) ||
        !port_.send(frame))
        return {};
    return frame;
}

}  // namespace vibrig::rt
