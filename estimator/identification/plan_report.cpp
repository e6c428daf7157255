#include "estimator/identification/plan_report.hpp"

#include <cmath>
#include <limits>

#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/text.hpp"
#include "estimator/identification/observability.hpp"
#include "estimator/identification/planned_covariance.hpp"
#include "estimator/identification/two_step.hpp"

namespace vibrig::estimator {

PlanReport report_plan(const Settings& settings, const std::vector<PlannedDwell>& plan,
                       double period_s) {
    const ParameterArray prior = prior_sigma(settings);
    const Covariance posterior = planned_covariance(settings, plan, period_s);
    KappaSpread levels;
    for (const PlannedDwell& dwell : plan) levels.add(dwell.kappa);
    const Observability found = observability(posterior, prior, levels);
    PlanReport report;
    if (settings.method == Method::two_step) {
        std::map<int, KappaSpread> runs;
        for (const PlannedDwell& dwell : plan) runs[dwell.run].add(dwell.kappa);
        report.obstacle = two_step_obstacle(runs);
        if (!report.obstacle.empty()) {
            report.sigma.fill(std::numeric_limits<double>::quiet_NaN());
            return report;
        }
    }
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t a = internal_of(i);
        const auto k = static_cast<Eigen::Index>(a);
        report.observable[i] = found.observable[a];
        report.sigma[i] = found.observable[a] ? std::sqrt(posterior(k, k))
                                              : std::numeric_limits<double>::quiet_NaN();
    }
    report.combinations = determined_combinations(found, posterior, ParameterArray{}, prior);
    return report;
}

std::vector<PlannedDwell> campaign_plan(const Settings& settings,
                                        const std::vector<std::array<double, 3>>& positions_deg,
                                        const std::vector<double>& table_g, double dwell_s) {
    std::vector<PlannedDwell> plan;
    int run = 0;
    for (const double level : table_g) {
        ++run;
        const double a0 = settings.transmission * level;
        for (const std::array<double, 3>& position : positions_deg) {
            plan.push_back({gimbal_deg(settings, position), 1.0 + 0.5 * a0 * a0, dwell_s, run});
        }
    }
    return plan;
}

std::vector<std::string> plan_warnings(const PlanReport& report) {
    std::vector<std::string> lines;
    std::string names;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (!report.observable[i]) names += std::string(" ") + parameter_names()[i];
    }
    if (names.empty()) return lines;
    lines.push_back("these positions and levels do not determine one by one:" + names);
    if (!report.obstacle.empty()) {
        lines.push_back(report.obstacle);
        return lines;
    }
    if (report.combinations.empty()) lines.emplace_back("no combination of them is determined");
    for (const Combination& combination : report.combinations) {
        std::string sum;
        for (const auto& [name, weight] : combination.weights) {
            sum += sum.empty() ? (weight < 0 ? "-" : "") : (weight < 0 ? " - " : " + ");
            sum += (std::abs(weight) == 1.0 ? "" : text("%.6g ", std::abs(weight))) + name;
        }
        lines.push_back("determined is " + sum + text(", expected sigma %.2g", combination.sigma));
    }
    return lines;
}

}  // namespace vibrig::estimator
