#include "daemon/status/status.hpp"

#include <algorithm>
#include <cmath>

#include "proto/word_of.hpp"

namespace vibrig {

const char* name_of(ChannelState state) noexcept {
    static constexpr std::array kWords{"good",    "missing", "flagged", "out_of_range",
                                       "unbound", "silent",  "never"};
    return proto::word_of(kWords, state);
}

ChannelState StatusData::channel(std::size_t c) const noexcept {
    using drivers::Quality;
    if (sample.time == 0) return ChannelState::never;
    if (sample.quality[c] == Quality::unbound) return ChannelState::unbound;
    const bool ever = channel_age_s[c] >= 0;
    if (silent || drivers::to_seconds(time - sample.time) > channel_deadline_s)
        return ever ? ChannelState::silent : ChannelState::never;
    switch (sample.quality[c]) {
        case Quality::good:
            return ChannelState::good;
        case Quality::missing:
            return ChannelState::missing;
        case Quality::flagged:
            return ChannelState::flagged;
        case Quality::out_of_range:
            return ChannelState::out_of_range;
        default:
            return ever ? ChannelState::silent : ChannelState::never;
    }
}

ChannelState StatusData::platform_state() const noexcept {
    if (platform.time == 0) return ChannelState::never;
    return silent || drivers::to_seconds(time - platform.time) > platform_deadline_s
               ? ChannelState::silent
               : ChannelState::good;
}

double InterlockStatus::Row::margin() const noexcept {
    if (!has_limit || !std::isfinite(present)) return std::numeric_limits<double>::quiet_NaN();
    // What has to stay below zero, or above it, has no scale of its own.
    const double left = below ? (present > 0        ? 1 - limit / present
                                 : present >= limit ? 1.0
                                                    : 0.0)
                              : (limit > 0          ? 1 - present / limit
                                 : present <= limit ? 1.0
                                                    : 0.0);
    return std::clamp(left, 0.0, 1.0);
}

}  // namespace vibrig
