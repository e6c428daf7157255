#include "daemon/campaign/stages/waiting.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::Time;

void Waiting::begin(Time now) {
    begun_ = now;
    temperatures_.clear();
}

void Waiting::look_at(const drivers::PlatformStatus& platform, Time now) {
    if (!platform.knows_temperature(now)) return temperatures_.clear();
    const Time at = platform.temperature_time;
    if (temperatures_.empty() || at > temperatures_.back().first)
        temperatures_.emplace_back(at, platform.temperature_c);
    const Time window = from_seconds(settings_.temperature_window_s);
    while (temperatures_.size() > 2 && temperatures_[1].first <= now - window)
        temperatures_.pop_front();
}

bool Waiting::steady(Time now) const {
    if (settings_.temperature_window_s == 0) return true;  // not asked
    const Time window = from_seconds(settings_.temperature_window_s);
    if (temperatures_.empty() || temperatures_.front().first > now - window) return false;
    const auto [low, high] =
        std::ranges::minmax(temperatures_, {}, &std::pair<Time, double>::second);
    return high.second - low.second <= settings_.temperature_band_c;
}

StageStep Waiting::step(Time now) {
    const auto platform = rig_.platform();
    look_at(platform, now);
    words_ = platform_lacks(platform, now);
    const bool is_steady = steady(now);
    if (platform_is_silent(platform, now)) temperatures_.clear();
    if (words_.empty() && !is_steady)
        words_ = temperatures_.empty() ? "no temperature on the bus" : "temperature not steady";
    if (words_.empty()) return StageStep::done();
    if (now - begun_ > from_seconds(settings_.ready_timeout_s))
        return StageStep::failed(fmt::format("{} after {:g} s", words_, settings_.ready_timeout_s));
    return StageStep::going_on(now + drivers::kSecond);
}

}  // namespace vibrig::campaign
