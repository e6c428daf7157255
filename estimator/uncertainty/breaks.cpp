#include "estimator/uncertainty/breaks.hpp"

#include <set>

namespace vibrig::estimator::uncertainty {
namespace {

/// Dwells after which another run begins or a former one goes on. An order that goes back to former
/// runs again and again mixes the levels, and nobody switches the gyros off at each change of
/// level; a dwell or two of a former run, at rest or repeated, make no mixed order.
std::vector<std::size_t> ends_of_runs(const DwellTable& table) {
    constexpr std::size_t kBack = 8;  // of so many dwells one
    std::vector<std::size_t> ends;
    std::set<int> begun;
    std::size_t back = 0;
    int newest = 0;
    for (std::size_t k = 0; k < table.rows.size(); ++k) {
        const int run = table.rows[k].run;
        if (begun.insert(run).second)
            newest = run;
        else if (run != newest)
            ++back;
        if (k > 0 && run != table.rows[k - 1].run) ends.push_back(k);
    }
    if (kBack * back > table.rows.size()) return {};
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
