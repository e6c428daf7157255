#include <algorithm>
#include <numeric>
#include <string_view>

#include "daemon/tool/design/plan_study.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/uncertainty/planned.hpp"

namespace vibrig::tool::planner {

namespace uncertainty = estimator::uncertainty;

namespace {

std::array<double, estimator::kParameters> typical() {
    std::array<double, estimator::kParameters> of{};
    for (std::size_t i = 0; i < of.size(); ++i)
        of[i] = std::string_view(estimator::parameter_unit(i)) == "deg/h/g^2" ? 0.03 : 1.0;
    return of;
}

}  // namespace

PlanUncertainty plan_uncertainty(const estimator::Settings& settings,
                                 const std::vector<planning::Visit>& visits,
                                 const planning::Timing& timing, double period_s) {
    std::vector<uncertainty::PlannedStop> stops;
    std::vector<planning::Row> rows;
    std::vector<double> levels;
    planning::Vec3 here{};
    double now_s = 0;
    for (const planning::Visit& visit : visits) {
        const double ramp_s = visit.level_g > 0 ? timing.ramp_s : 0;
        now_s += planning::slew_s(here, visit.position_deg, timing) + ramp_s + timing.settle_s;
        here = visit.position_deg;
        auto level = std::find(levels.begin(), levels.end(), visit.level_g);
        if (level == levels.end()) level = levels.insert(level, visit.level_g);
        uncertainty::PlannedStop stop;
        stop.run = static_cast<int>(level - levels.begin()) + 1;
        stop.position = static_cast<int>(stops.size()) + 1;
        stop.angles_deg = estimator::gimbal_deg(settings, visit.position_deg);
        stop.amplitude_g = visit.level_g;
        stop.begin_s = now_s;
        stop.duration_s = timing.dwell_s;
        stops.push_back(stop);
        rows.push_back(
            planning::vibration_row(planning::up_at(settings, visit.position_deg), visit.level_g));
        now_s += timing.dwell_s + ramp_s;
    }
    PlanUncertainty out;
    const auto result = uncertainty::planned_result(settings, stops, typical(), period_s);
    out.assessed = uncertainty::assess(settings, result);
    planning::Order order(visits.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    out.merit = uncertainty::merit_of(visits, order, rows, timing,
                                      estimator::rate_variance(settings, timing.dwell_s, period_s));
    return out;
}

}  // namespace vibrig::tool::planner
