#include "daemon/guard/motion.hpp"

#include <cmath>
#include <numbers>

namespace vibrig::guard {

void MotionWindow::add(double time_s, const std::array<double, 3>& force_g) {
    for (std::size_t i = 0; i < axes_; ++i)
        if (!std::isfinite(force_g[i])) return;
    if (!points_.empty() && time_s < points_.back().time_s) points_.clear();
    points_.push_back({time_s, force_g});
    while (points_.front().time_s < time_s - window_s_) points_.pop_front();
}

Motion MotionWindow::at(double now_s) const {
    // Of a window that is mostly empty, or old, nothing can be said.
    if (points_.size() < kLeast || points_.back().time_s < now_s - window_s_ / 2 ||
        points_.back().time_s - points_.front().time_s < 0.8 * window_s_)
        return {};
    const auto n = static_cast<double>(points_.size());
    std::array<double, 3> mean{};
    double mean_time = 0, mean_size = 0;
    const auto size_of = [this](const Point& point) {
        // One axis keeps its sign: it may swing about zero.
        return axes_ == 1 ? point.force_g[0]
                          : std::hypot(point.force_g[0], point.force_g[1], point.force_g[2]);
    };
    for (const Point& point : points_) {
        mean_time += point.time_s / n;
        mean_size += size_of(point) / n;
        for (std::size_t i = 0; i < axes_; ++i) mean[i] += point.force_g[i] / n;
    }
    double times = 0, sizes = 0, squares = 0;
    std::array<double, 3> products{};
    for (const Point& point : points_) {
        const double t = point.time_s - mean_time;
        times += t * t;
        sizes += (size_of(point) - mean_size) * (size_of(point) - mean_size);
        for (std::size_t i = 0; i < axes_; ++i) {
            const double f = point.force_g[i] - mean[i];
            products[i] += t * f;
            squares += f * f;
        }
    }
    for (const double product : products) squares -= product * product / times;
    return {true, std::sqrt(sizes / n), std::numbers::sqrt2 * std::sqrt(std::fmax(squares, 0) / n)};
}

}  // namespace vibrig::guard
