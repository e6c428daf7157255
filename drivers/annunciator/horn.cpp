#include "drivers/annunciator/horn.hpp"

#include <array>

#include "proto/word_of.hpp"

namespace vibrig::drivers {

namespace {

// A device that is quiet now may be gone when it is needed, so it is asked all the time.
constexpr Time kHornPoll = 500 * kMillisecond;
constexpr Time kHornRetry = kSecond;

ShakerSettings link_settings(const HornSettings& settings) {
    ShakerSettings link;
    link.host = settings.host;
    link.port = settings.port;
    link.unit = settings.unit;
    link.response_timeout = settings.response_timeout;
    return link;
}

}  // namespace

const char* name_of(HornPattern pattern) noexcept {
    static constexpr std::array kWords{"none", "alarm", "abort", "disobeyed"};
    return proto::word_of(kWords, pattern);
}

bool horn_sounds(HornPattern pattern, Time since) noexcept {
    switch (pattern) {
        case HornPattern::none:
            return false;
        case HornPattern::alarm:
            return since % (10 * kSecond) < kSecond / 2;
        case HornPattern::abort:
            return since % (2 * kSecond) < kSecond;
        case HornPattern::disobeyed:
            return true;
    }
    return true;
}

Horn::Horn(const HornSettings& settings)
    : link_(link_settings(settings)),
      horn_{"horn", settings.horn_coil},
      lamp_{"lamp", settings.lamp_coil} {}

bool Horn::reach(Time now) {
    if (link_.connected()) return true;
    if (now < next_attempt_) return false;
    next_attempt_ = now + kHornRetry;
    std::string why;
    if (link_.connect(why) == ModbusLink::Connection::open) return true;
    note_ = link_.name() + ": " + why;
    return false;
}

bool Horn::lose(const Reply& reply) {
    note_ = link_.name() + ": " + reply.text();
    if (reply.kind != ReplyKind::exception) link_.close();
    return false;
}

bool Horn::set(Coil& coil, bool on) {
    if (coil.address < 0) return true;
    const auto address = static_cast<std::uint16_t>(coil.address);
    bool is_on = false;
    if (const Reply reply = link_.read_coil(address, is_on); !reply.ok()) return lose(reply);
    // Off is said once, when this side has done: another one may want it on.
    if (is_on != on && (on || coil.on)) {
        if (const Reply reply = link_.write_coil(address, on); !reply.ok()) return lose(reply);
        if (const Reply reply = link_.read_coil(address, is_on); !reply.ok()) return lose(reply);
    }
    coil.on = on;
    if (is_on || !on) return true;
    note_ = link_.name() + ": the " + coil.name + " (coil " + std::to_string(coil.address) +
            ") was switched on and reads back off";
    return false;
}

bool Horn::show(HornPattern pattern, Time now) {
    if (pattern != pattern_) {
        pattern_ = pattern;
        begun_ = now;
    }
    if (!reach(now)) return false;
    const bool horn = set(horn_, horn_sounds(pattern_, now - begun_));
    const bool lamp = link_.connected() && set(lamp_, pattern_ != HornPattern::none);
    if (!horn || !lamp) return false;
    note_.clear();
    return true;
}

Time Horn::next(Time now) const noexcept {
    // The beats of all patterns are multiples of half a second.
    return now + kHornPoll - (now - begun_) % kHornPoll;
}

}  // namespace vibrig::drivers
