#include "tests/plant/gimbals.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::plant {

namespace {
constexpr double kInPosition = 0.005;  ///< deg
}

void Gimbals::slew_to(const Vec3& encoder_deg, GimbalMode mode) noexcept {
    target_ = encoder_deg;
    mode_ = mode;
    moving_ = true;
}

bool Gimbals::advance(double dt_s, Vec3& encoder_deg) noexcept {
    if (!slewing()) return false;
    double largest = 0;
    double first = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const double gap = std::remainder(target_[i] - encoder_deg[i], 360.0);
        first = std::max(first, std::abs(gap));
        const bool stuck = stuck_ && static_cast<std::size_t>(*stuck_) == i;
        double step = stuck ? 0 : std::clamp(gap, -rate_ * dt_s, rate_ * dt_s);
        const double from_middle = std::remainder(encoder_deg[i] - stops_.middle_deg[i], 360.0);
        const double reach = stops_.reach_deg[i];
        // One that has drifted beyond it may come back.
        if (step > 0) step = std::min(step, std::max(0.0, reach - from_middle));
        if (step < 0) step = std::max(step, std::min(0.0, -reach - from_middle));
        encoder_deg[i] += step;
        largest = std::max(largest, std::abs(gap - step));
    }
    moving_ = largest > kInPosition;
    return !moving_ && first > kInPosition;
}

}  // namespace vibrig::plant
