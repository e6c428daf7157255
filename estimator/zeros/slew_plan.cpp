#include "estimator/zeros/slew_plan.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace vibrig::estimator::zeros {
namespace {

/// Leg of the plan in which a time falls.
struct Leg {
    double from = 0, to = 0, begin_s = 0, end_s = 0;
};

Leg leg_at(const SlewPlan& plan, double time_s) noexcept {
    const std::size_t n = plan.targets_deg.size();
    Leg leg{plan.targets_deg[0], plan.targets_deg[0], 0, 0};
    for (std::size_t i = 1; i < n; ++i) {
        leg.from = plan.targets_deg[i - 1];
        leg.to = plan.targets_deg[i];
        leg.begin_s = leg.end_s;
        leg.end_s += std::abs(leg.to - leg.from) / plan.rate_deg_s;
        if (time_s < leg.end_s) return leg;
    }
    const double length = leg.end_s - leg.begin_s;
    if (n < 2 || length <= 0) return {leg.to, leg.to, leg.end_s, time_s + 1};
    const double turns = std::floor((time_s - leg.end_s) / length);
    const bool back = std::fmod(turns, 2.0) == 0;
    const double begin = leg.end_s + turns * length;
    return back ? Leg{leg.to, leg.from, begin, begin + length}
                : Leg{leg.from, leg.to, begin, begin + length};
}

}  // namespace

bool SlewPlan::turns() const noexcept {
    return std::any_of(targets_deg.begin(), targets_deg.end(),
                       [&](double target) { return target != targets_deg.front(); });
}

double SlewPlan::azimuth_deg(double time_s) const noexcept {
    const Leg leg = leg_at(*this, std::max(0.0, time_s));
    if (leg.to == leg.from) return leg.to;
    const double part = (std::max(0.0, time_s) - leg.begin_s) / (leg.end_s - leg.begin_s);
    return leg.from + part * (leg.to - leg.from);
}

double SlewPlan::sweep_s() const noexcept {
    const std::size_t n = targets_deg.size();
    const double back = n < 2 ? 0 : 2 * std::abs(targets_deg[n - 1] - targets_deg[n - 2]);
    return back > 0 ? back / rate_deg_s : duration_s;
}

std::vector<double> SlewPlan::segments_deg() const {
    std::vector<double> found;
    const auto add = [&](double azimuth) {
        const bool known = std::any_of(found.begin(), found.end(),
                                       [&](double a) { return std::abs(a - azimuth) < 1e-9; });
        if (!known) found.push_back(azimuth);
    };
    add(targets_deg.front());
    double time_s = 0;
    for (std::size_t i = 1; i < targets_deg.size(); ++i) {
        time_s += std::abs(targets_deg[i] - targets_deg[i - 1]) / rate_deg_s;
        if (time_s > duration_s) {
            add(azimuth_deg(duration_s));
            break;
        }
        add(targets_deg[i]);
    }
    return found;
}

void SlewPlan::check() const {
    const auto require = [](bool good, const char* name, double value, const char* expected) {
        if (!good) {
            throw ZeroError(std::string(name) + ": " + std::to_string(value) + ", expected " +
                            expected);
        }
    };
    if (targets_deg.empty()) {
        throw ZeroError("slew plan: no azimuth, expected at least one");
    }
    for (const double target : targets_deg) {
        require(std::isfinite(target) && std::abs(target) <= 360, "azimuth of the slew plan",
                target, "degrees, -360 to 360");
    }
    require(std::isfinite(rate_deg_s) && rate_deg_s > 0, "slew rate", rate_deg_s,
            "deg/s, more than 0");
    require(std::isfinite(duration_s) && duration_s > 0 && duration_s <= 86400, "duration",
            duration_s, "s, more than 0, at most a day");
}

}  // namespace vibrig::estimator::zeros
