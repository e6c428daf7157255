#include "daemon/plan/forecast.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/positions.hpp"
#include "proto/printed.hpp"

namespace vibrig::plan {

namespace {

using proto::printed;

/// Levels closer than this, relative, in kappa, barely separate constant and squares.
constexpr double kCloseLevels = 0.05;

std::string describe(const planning::Vec3& position, double level_g) {
    return printed("(%g, %g, %g) deg at %g g", position[0], position[1], position[2], level_g);
}

/// One more level first: a static run costs least.
std::string remedy(const estimator::Settings& settings, const planning::Problem& problem,
                   const planning::Effort& effort, const std::vector<PlannedRun>& runs) {
    std::vector<planning::Point> extra;
    std::vector<std::string> names;
    std::vector<double> levels{0};
    double highest = 0;
    for (const PlannedRun& run : runs) highest = std::max(highest, run.level_g);
    levels.push_back(highest > 0 ? highest : 6.0);
    const auto offer = [&](const planning::Vec3& position, double level) {
        const auto up = planning::up_at(settings, position);
        // Static runs cost no shaker time; vibrating ones ramp as well.
        extra.push_back({planning::vibration_row(up, level), 1, level > 0 ? 1.1 : 1.0});
        names.push_back(describe(position, level));
    };
    for (const double level : levels) {
        for (const PlannedRun& run : runs) offer(run.position_deg, level);
        for (const auto& direction : planning::cube_directions()) {
            if (const auto p = planning::position_for(settings, direction, {})) offer(*p, level);
        }
    }
    const planning::Remedy found = planning::cheapest_remedy(problem, effort, extra);
    if (found.points.empty()) return "none of the 26 directions at rest or in vibration helps";
    std::string text = found.complete ? "cheapest remedy: add " : "it helps to add ";
    for (std::size_t k = 0; k < found.points.size(); ++k) {
        text += (k == 0 ? "" : ", ") + names[found.points[k]];
    }
    return text;
}

std::string not_determined(const estimator::Settings& settings,
                           const planning::Evaluation& evaluation) {
    std::string text;
    for (const planning::Row& null : evaluation.null_vectors) {
        std::string platform, gyros;
        for (std::size_t i = 0; i < planning::kTerms; ++i) {
            if (null[i] == 0) continue;
            platform += (platform.empty() ? "" : ", ") + std::string(planning::kTermNames[i]);
            gyros += (gyros.empty() ? "" : ", ") + gyro_names(settings, i);
        }
        const bool several = platform.find(',') != std::string::npos;
        text += (text.empty() ? "" : "; ") + platform + (several ? " apart" : " at all") + " (" +
                gyros + ")";
    }
    return text;
}

std::string close_levels(const std::vector<PlannedRun>& runs) {
    double least = 1e300, largest = 0;
    for (const PlannedRun& run : runs) {
        least = std::min(least, planning::kappa_of(run.level_g));
        largest = std::max(largest, planning::kappa_of(run.level_g));
    }
    const double apart = (largest - least) / largest;
    if (apart >= kCloseLevels) return {};
    // Their standard errors go with 1 / |k2 - k1| (Tang et al. 2009, eq. 16).
    const double wanted = largest - 2 * (largest - least);
    const std::string halve =
        wanted >= 1
            ? printed("a lowest level of %.3g g would halve them", std::sqrt(2 * (wanted - 1)))
            : printed("a highest level of %.3g g would halve them",
                      std::sqrt(2 * (least + 2 * (largest - least) - 1)));
    return printed(
               "the levels' kappa differ by %.2g %% only: constants and squares are told apart "
               "badly; ",
               100 * apart) +
           halve;
}

}  // namespace

std::string gyro_names(const estimator::Settings& settings, std::size_t term) {
    constexpr const char* kGyro = "xyz";
    constexpr const char* kRole = "IOS";
    if (term == 0) return "D_Fx, D_Fy, D_Fz";
    const auto role = [&](std::size_t gyro, int axis) {
        for (std::size_t k = 0; k < 3; ++k) {
            if (settings.gyro_axes[gyro][k].axis == axis) return k;
        }
        return std::size_t{0};
    };
    constexpr std::array<std::array<int, 2>, planning::kTerms> kAxes{
        {{-1, -1}, {0, -1}, {1, -1}, {2, -1}, {0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
    std::string text;
    for (std::size_t gyro = 0; gyro < estimator::kGyros; ++gyro) {
        std::size_t a = role(gyro, kAxes[term][0]);
        std::string name = "D_";
        if (kAxes[term][1] < 0) {
            name += kRole[a];
        } else {
            std::size_t b = role(gyro, kAxes[term][1]);
            if (a > b) std::swap(a, b);
            name += kRole[a];
            name += kRole[b];
        }
        text += (gyro == 0 ? "" : ", ") + name + kGyro[gyro];
    }
    return text;
}

Forecast forecast(const estimator::Settings& settings, const std::vector<PlannedRun>& planned,
                  double dwell_s, double period_s, const planning::Terms& terms) {
    std::vector<PlannedRun> runs;  // what is held out tells of no coefficient
    std::ranges::copy_if(planned, std::back_inserter(runs),
                         [](const PlannedRun& run) { return !run.verify; });
    planning::Problem problem;
    problem.terms = terms;
    planning::Effort effort;
    std::vector<estimator::PlannedDwell> dwells;
    for (const PlannedRun& run : runs) {
        problem.points.push_back(
            {planning::vibration_row(planning::up_at(settings, run.position_deg), run.level_g)});
        effort.push_back(static_cast<double>(run.count));
        dwells.insert(dwells.end(), run.count,
                      {estimator::gimbal_deg(settings, run.position_deg),
                       planning::kappa_of(run.level_g), dwell_s});
    }
    const planning::Evaluation evaluation = planning::evaluate(problem, effort);
    Forecast result;
    result.rank = evaluation.rank;
    result.identifies_all = evaluation.identifies_all();
    result.sigma = estimator::predicted_sigma(settings, dwells, {}, period_s);
    if (!result.identifies_all) {
        result.refusal = printed("rank %zu of %zu: the plan does not determine ", evaluation.rank,
                                 evaluation.coefficients) +
                         not_determined(settings, evaluation) + "; " +
                         remedy(settings, problem, effort, runs);
    } else {
        result.warning = close_levels(runs);
    }
    return result;
}

std::string forecast_table(const Forecast& forecast) {
    const auto& names = estimator::parameter_names();
    std::string text = "expected standard errors  gyro x      gyro y      gyro z\n";
    for (std::size_t k = 0; k < estimator::kGroups; ++k) {
        std::string name = names[k];
        name.pop_back();
        text += printed("  %-5s %-16s", name.c_str(), estimator::parameter_unit(k));
        for (std::size_t gyro = 0; gyro < 3; ++gyro) {
            const double sigma = forecast.sigma[estimator::kGroups * gyro + k];
            text += std::isfinite(sigma) ? printed("%12.3g", sigma) : printed("%12s", "-");
        }
        text += '\n';
    }
    return text;
}

}  // namespace vibrig::plan
