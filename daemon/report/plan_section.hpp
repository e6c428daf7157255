#pragma once

#include <cstddef>
#include <string>

#include "daemon/report/analysis.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {

/// What the positions and levels of a campaign were worth, as it was run, for one gyro: the same
/// for all three.
struct PlanFigures {
    std::size_t runs = 0, directions = 0, levels = 0, rank = 0;
    double d_efficiency = 0;  ///< 0: the plan does not determine everything
    double bound = 0;         ///< by the equivalence theorem, among the plan's own points
    std::string undetermined;
    bool by_candidates = false;  ///< compared with the 26 directions; else with its own points
};

[[nodiscard]] PlanFigures plan_figures(const record::Campaign& campaign, const Analysis& analysis);
void add_plan(Page& page, const record::Campaign& campaign, const Analysis& analysis);
/// The files with their hashes.
void add_files(Page& page, const record::Campaign& campaign);

}  // namespace vibrig::report
