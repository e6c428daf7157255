#include "daemon/campaign/in_step_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace vibrig::campaign {
namespace {

constexpr double kSame_hz = 0.05;
constexpr std::array<const char*, 3> kMostMoved{"outer", "inner", "azimuth"};

}  // namespace

InStepWatch::InStepWatch(const estimator::Settings& rig, double sample_s, FoundInStep before,
                         double hz, std::array<double, 2> limits)
    : rig_(rig), sample_s_(sample_s), before_(before), hz_(hz), limits_(limits) {}

std::optional<InStepWatch::Look> InStepWatch::add(const estimator::LoopReading& reading) {
    const bool whole = !window_.empty() && reading.time_s - window_.front().time_s >= kWindow_s;
    std::optional<Look> look;
    if (whole) {
        const auto count = static_cast<double>(window_.size());
        if (count * sample_s_ >= kWindow_s / 2)
            if (const auto now = estimator::in_step(window_, hz_, rig_); now.platform_g > 0)
                look = judge(now);
        window_.clear();
    }
    window_.push_back(reading);
    return look;
}

InStepWatch::Look InStepWatch::judge(const estimator::InStep& now) {
    const estimator::InStep& before = before_.found;
    const auto motion = estimator::motion_growth(before, now);
    const auto across = estimator::cross_growth(before, now, hz_, rig_);
    Look look{{motion.times, across.times}, {}};
    const auto newly = [&](std::size_t which) {
        return look.times[which] > limits_[which] && !std::exchange(said_[which], true);
    };
    if (newly(0)) {
        const auto most = std::ranges::max_element(now.gimbal_arcsec);
        look.said.push_back(fmt::format(
            "at {:g} Hz the platform moves in step with the vibration by {:.3g} arcsec per g "
            "({} gimbal most, {:.3g} arcsec at {:.3g} g), expected {:.3g} as at the loop check, "
            "limit {:.3g}",
            before_.hz, now.motion_arcsec_g,
            kMostMoved[static_cast<std::size_t>(std::distance(now.gimbal_arcsec.begin(), most))],
            *most, now.platform_g, before.motion_arcsec_g, limits_[0] * motion.expected));
    }
    if (newly(1))
        look.said.push_back(fmt::format(
            "at {:g} Hz {:.3g} of the motion along the vertical goes across it, expected {:.3g} as "
            "at the loop check, limit {:.3g}",
            before_.hz, now.cross_share, before.cross_share, limits_[1] * across.expected));
    return look;
}

std::optional<FoundInStep> found_at(const std::vector<FoundInStep>& found, double hz,
                                    const estimator::Settings& rig) {
    const auto near = [&](double at_hz) {
        return std::ranges::find_if(
            found, [&](const auto& one) { return std::abs(one.hz - at_hz) <= kSame_hz; });
    };
    auto at = near(hz);
    if (at == found.end() && estimator::at_reference(rig, hz)) at = near(rig.frequency_hz);
    return at == found.end() ? std::nullopt : std::optional(*at);
}

}  // namespace vibrig::campaign
