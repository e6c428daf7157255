#include "estimator/uncertainty/breaks.hpp"

#include <set>

namespace vibrig::estimator::uncertainty {
namespace {

/// Dwells after which each run of a plain order ends. An order that returns to a run mixes the
/// levels, and nobody switches the gyros off at each change of level.
std::vector<std::size_t> ends_of_runs(const DwellTable& table) {
    std::vector<std::size_t> ends;
    std::set<int> begun;
    for (std::size_t k = 0; k < table.rows.size(); ++k) {
        if (k > 0 && table.rows[k].run == table.rows[k - 1].run) continue;
        if (!begun.insert(table.rows[k].run).second) return {};
        if (k > 0) ends.push_back(k);
    }
    return ends;
}

}  // namespace

std::vector<std::size_t> breaks_of(const DwellTable& table, const Drift& drift) {
    if (drift.power == Power::unbroken) return {};
    std::set<std::size_t> breaks;
    if (drift.power == Power::per_run) {
        for (const std::size_t k : ends_of_runs(table)) breaks.insert(k);
    }
    for (std::size_t k = 1; k < table.rows.size(); ++k) {
        if (table.rows[k].after_power_loss) breaks.insert(k);
    }
    return {breaks.begin(), breaks.end()};
}

}  // namespace vibrig::estimator::uncertainty
