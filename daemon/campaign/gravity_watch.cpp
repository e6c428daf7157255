#include "daemon/campaign/gravity_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "estimator/filter/angles.hpp"

namespace vibrig::campaign {

namespace {

using estimator::kDegPerRad;

constexpr std::size_t kMostLooks = 8, kMostSuspects = 3;
constexpr std::array kGimbals{"outer", "inner", "azimuth"};

double angle_deg(const Vector& a, const Vector& b) {
    const Vector across = cross(a, b);
    return std::atan2(std::sqrt(dot(across, across)), dot(a, b)) * kDegPerRad;
}

}  // namespace

GravityWatch::GravityWatch(const estimator::Settings& rig, const GravityLimits& limits)
    : rig_(rig), limits_(limits), frame_(rig) {}

GravityWatch::Verdict GravityWatch::judge(const rt::MeanMotion& second, const Vector& zero_g,
                                          bool at_rest) {
    Vector off{};
    for (std::size_t i = 0; i < 3; ++i) off[i] = second.force[i] - zero_g[i];
    const auto of = [&m = rig_.accelerometer_matrix](const Vector& raw) {
        return Vector{dot(m[0], raw), dot(m[1], raw), dot(m[2], raw)};
    };
    const Vector force = of(off), up = frame_.up(second.angle);
    newest_.known = true;
    newest_.size_g = std::sqrt(dot(force, force));
    newest_.angle_deg = angle_deg(up, force);
    // Whatever its phase, and be it an ellipse: the share of its power that is along the vertical.
    const Vector cosine = of(second.cosine), sine = of(second.sine);
    const double power = dot(cosine, cosine) + dot(sine, sine);
    const double along = std::hypot(dot(cosine, up), dot(sine, up));
    newest_.vibration_g = std::sqrt(power);
    newest_.vibration_deg =
        newest_.vibration_g < limits_.vibration_g
            ? 0
            : std::atan2(std::sqrt(std::max(power - along * along, 0.0)), along) * kDegPerRad;
    newest_.vibration_off = !(newest_.vibration_deg <= limits_.vibration_deg);
    const bool size = !at_rest || std::abs(newest_.size_g - 1) <= limits_.size;
    newest_.size_off = !size;
    newest_.warned = !(newest_.angle_deg <= limits_.warn_deg) || !size;
    newest_.refused = !(newest_.angle_deg <= limits_.refused_deg) || !size;
    if (std::exchange(fresh_, false) || looks_.empty()) {
        looks_.push_back({});
        if (looks_.size() > kMostLooks) looks_.pop_front();
    }
    looks_.back() = {second.angle, force};
    return newest_;
}

std::string GravityWatch::words() const {
    return fmt::format(
        "gravity {:.2f} deg off what the encoders say (warned above {:g}, no ramp above {:g} deg), "
        "{:.3f} g (1 within {:g})",
        newest_.angle_deg, limits_.warn_deg, limits_.refused_deg, newest_.size_g, limits_.size);
}

std::string GravityWatch::vibration_words() const {
    return fmt::format(
        "the vibration of {:.2f} g is {:.1f} deg off the vertical by the encoders (warned above "
        "{:g} "
        "deg): motion across it, or an accelerometer that follows gravity and not the vibration",
        newest_.vibration_g, newest_.vibration_deg, limits_.vibration_deg);
}

double GravityWatch::worst_deg(const estimator::Settings& rig) const {
    const RigFrame frame(rig);
    double worst = 0;
    for (const Look& look : looks_)
        worst = std::max(worst, angle_deg(frame.up(look.encoder_rad), look.force));
    return worst;
}

void GravityWatch::consider(Suspects& found, double worst, std::string words) const {
    if (worst <= limits_.warn_deg) found.emplace_back(worst, std::move(words));
}

void GravityWatch::consider_encoder(Suspects& found, std::size_t gimbal) const {
    auto rig = rig_;
    rig.encoder_sign[gimbal] = -rig.encoder_sign[gimbal];
    consider(found, worst_deg(rig),
             fmt::format("platform.encoder_sign of the {} gimbal", kGimbals[gimbal]));
    // Another zero: the best by whole degrees, then finer.
    rig = rig_;
    double best = 1e9, zero = 0;
    for (const double step : {1.0, 0.05}) {
        const double middle = zero;
        const int count = step == 1.0 ? 180 : 20;
        for (int n = -count; n <= count; ++n) {
            rig.encoder_zero_deg[gimbal] = rig_.encoder_zero_deg[gimbal] + middle + n * step;
            const double worst = worst_deg(rig);
            if (worst >= best) continue;
            best = worst;
            zero = middle + n * step;
        }
    }
    const double configured = rig_.encoder_zero_deg[gimbal];
    consider(found, best,
             fmt::format("platform.encoder_zero_deg of the {} gimbal, {:.2f} instead of {:g}",
                         kGimbals[gimbal], configured + zero, configured));
}

/// Accelerometers swapped or wired the wrong way round; what the vertical shows of it.
void GravityWatch::consider_accelerometers(Suspects& found) const {
    std::array<std::size_t, 3> order{0, 1, 2};
    do {
        for (int signs = 0; signs < 8; ++signs) {
            if (signs == 0 && std::ranges::is_sorted(order)) continue;
            double worst = 0;
            for (const Look& look : looks_) {
                Vector force{};
                for (std::size_t i = 0; i < 3; ++i)
                    force[i] = ((signs >> i) % 2 == 0 ? 1 : -1) * look.force[order[i]];
                worst = std::max(worst, angle_deg(frame_.up(look.encoder_rad), force));
            }
            std::string words = "accelerometers x, y, z are";
            for (std::size_t i = 0; i < 3; ++i)
                words += fmt::format("{} {}{}", i == 0 ? "" : ",",
                                     (signs >> i) % 2 == 0 ? '+' : '-', "xyz"[order[i]]);
            consider(found, worst, words);
        }
    } while (std::ranges::next_permutation(order).found);
}

void GravityWatch::consider_up(Suspects& found) const {
    for (const int axis : {0, 1, 2}) {
        for (const int sign : {1, -1}) {
            if (axis == rig_.up.axis && sign == rig_.up.sign) continue;
            auto rig = rig_;
            rig.up = {axis, sign};
            consider(found, worst_deg(rig),
                     fmt::format("platform.up, {}{} instead of {}{}", sign > 0 ? '+' : '-',
                                 "xyz"[axis], rig_.up.sign > 0 ? '+' : '-', "xyz"[rig_.up.axis]));
        }
    }
}

std::string GravityWatch::suspects() const {
    // What turns or swaps axes leaves the size as it is.
    if (newest_.size_off)
        return "suspects, by the size of gravity: accelerometer.zero_g; accelerometer.matrix";
    Suspects found;
    for (std::size_t gimbal = 0; gimbal < 3; ++gimbal) consider_encoder(found, gimbal);
    consider_accelerometers(found);
    consider_up(found);
    std::ranges::stable_sort(found, {}, [](const auto& f) { return std::round(f.first * 20); });
    std::string text;
    for (std::size_t n = 0; n < std::min(found.size(), kMostSuspects); ++n)
        text += (n == 0 ? "suspects: " : "; ") + found[n].second;
    if (found.size() > kMostSuspects)
        text += fmt::format(" (and {} more)", found.size() - kMostSuspects);
    return text;
}

}  // namespace vibrig::campaign
