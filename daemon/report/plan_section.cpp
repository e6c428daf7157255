#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "daemon/record/digest.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/optimum.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::report {

namespace planning = estimator::plan;
namespace fs = std::filesystem;
using record::Campaign;

namespace {

/// For one gyro: the same for all three.
struct PlanFigures {
    std::size_t runs = 0, directions = 0, levels = 0, rank = 0;
    double d_efficiency = 0;  ///< 0: the plan does not determine everything
    double bound = 0;         ///< by the equivalence theorem, among the plan's own points
    std::string undetermined;
    bool by_candidates = false;  ///< compared with the 26 directions; else with its own points
};

constexpr double kSameDirection = 0.02;  // a degree or so: where the gimbals stop is not exact

/// What the encoders show at the beginning of a dwell that has samples, deg.
planning::Vec3 position_of(const Campaign& campaign, const record::RecordedDwell& dwell) {
    planning::Vec3 position{};
    for (std::size_t k = 0; k < 3; ++k)
        position[k] = campaign.samples[dwell.first].angle[k] * estimator::kDegPerRad;
    return position;
}

PlanFigures plan_figures(const Campaign& campaign, const Analysis& analysis) {
    PlanFigures out;
    const auto dwells = record::recorded_dwells(campaign);
    // Levels as the platform had them: mean over the dwells that were commanded alike.
    std::map<double, std::pair<double, double>> sums;
    const std::size_t count = std::min(dwells.size(), analysis.replayed.dwells.size());
    for (std::size_t d = 0; d < count; ++d) {
        if (apart(analysis.settings, *dwells[d].order)) continue;
        auto& [sum, n] = sums[dwells[d].order->table_g];
        sum += analysis.replayed.dwells[d].summary.amplitude_g;
        n += 1;
    }
    const auto level_of = [&](double table_g) {
        return sums.at(table_g).first / sums.at(table_g).second;
    };
    planning::Problem run, candidates;
    planning::Effort effort;
    std::set<std::array<long, 3>> directions;
    for (std::size_t d = 0; d < count; ++d) {
        if (dwells[d].count == 0 || apart(analysis.settings, *dwells[d].order)) continue;
        const auto position = position_of(campaign, dwells[d]);
        // As a recording may lie: a dwell that is nowhere is none of the plan.
        if (!std::ranges::all_of(position, [](double angle) { return std::isfinite(angle); }))
            continue;
        const auto up = planning::up_at(analysis.settings, position);
        run.points.push_back({planning::vibration_row(up, level_of(dwells[d].order->table_g))});
        effort.push_back(drivers::to_seconds(dwells[d].order->to - dwells[d].order->from));
        directions.insert({std::lround(up[0] / kSameDirection), std::lround(up[1] / kSameDirection),
                           std::lround(up[2] / kSameDirection)});
    }
    if (run.points.empty()) return out;
    for (const auto& [table_g, sum] : sums) {
        for (const auto& direction : planning::cube_directions())
            candidates.points.push_back({planning::vibration_row(direction, level_of(table_g))});
    }
    const auto evaluation = planning::evaluate(run, effort);
    out.runs = run.size();
    out.directions = directions.size();
    out.levels = sums.size();
    out.rank = evaluation.rank;
    out.undetermined = evaluation.undetermined();
    if (!evaluation.identifies_all()) return out;
    out.by_candidates =
        planning::evaluate(candidates, planning::Effort(candidates.size(), 1.0)).identifies_all();
    const auto optimum = planning::d_optimum(out.by_candidates ? candidates : run);
    out.d_efficiency = planning::d_efficiency(evaluation, optimum.log_det);
    out.bound = planning::equivalence_bound(run, effort);
    return out;
}

}  // namespace

void add_plan(Page& page, const Campaign& campaign, const Analysis& analysis) {
    page.section("plan", "Test plan");
    const PlanFigures plan = plan_figures(campaign, analysis);
    page.paragraph(
        fmt::format("As it was run: {} dwells with {} directions of the vertical and {} levels; "
                    "the information "
                    "of each gyro has rank {} of 10{}.",
                    plan.runs, plan.directions, plan.levels, plan.rank,
                    plan.undetermined.empty() ? "" : "; not determined: " + plan.undetermined));
    if (plan.d_efficiency > 0) {
        page.paragraph(
            fmt::format("D-efficiency {:.3f} of the best plan over {} at the same levels and "
                        "duration; at least "
                        "{:.3f} among its own runs (equivalence theorem of Kiefer and Wolfowitz). "
                        "The D-optimal "
                        "plan takes {:.3f} of the time for the same determinant.",
                        plan.d_efficiency,
                        plan.by_candidates ? "the 26 directions of the cube (faces, edges, corners)"
                                           : "its own directions",
                        plan.bound, plan.d_efficiency));
    } else {
        page.paragraph(
            "D-efficiency 0: no plan that leaves coefficients undetermined has another.");
    }
}

void add_files(Page& page, const Campaign& campaign) {
    Rows rows{{"File", "State", "Samples", "Bytes", "SHA-256"}};
    const auto add = [&rows](const std::string& path, const std::string& state,
                             const std::string& samples) {
        rows.push_back({fs::path(path).filename().string(), state, samples,
                        fmt::to_string(fs::file_size(path)), record::sha256_of_file(path)});
    };
    for (const auto& part : campaign.parts)
        add(part.path, part.state, fmt::to_string(part.samples));
    for (const auto& path : record::raw_files(campaign.folder)) add(path, "frames", "-");
    page.table(rows, "words hashes");
    for (const auto& words : record::missing_raw(campaign.folder, [](const auto&) {}))
        page.paragraph("Missing: " + words + ".");
}

}  // namespace vibrig::report
