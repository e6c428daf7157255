#include "daemon/order/campaign_order.hpp"

#include <numeric>
#include <random>

#include "estimator/identification/crlb.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/uncertainty/balanced_order.hpp"

namespace vibrig {

namespace {

using campaign::VisitOrder;
namespace plan = estimator::plan;

constexpr std::size_t kPositions = 14;
/// Table 1 at two levels, the second vibrating or at rest: position, negative at the second level.
/// Found with six starts of 6000 moves.
constexpr std::array<int, 2 * kPositions> kTwoLevels{9, -11, 5, -3, -7, 14,  -12, 13, -6,  2,
                                                     3, -4,  1, -2, 10, -9,  12,  -1, -14, 7,
                                                     8, -5,  6, -8, 4,  -13, 11,  -10};
constexpr std::array<int, 2 * kPositions> kLevelAndRest{-9, 11,  -11, -3,  3,   2,  -6, 4, -12, 8,
                                                        -8, 6,   13,  -13, 14,  7,  -4, 1, -2,  5,
                                                        -5, -10, 10,  9,   -14, 12, -1, -7};
constexpr std::uint64_t kSeed = 1;

std::vector<std::size_t> from_table(const std::array<int, 2 * kPositions>& table) {
    std::vector<std::size_t> sequence;
    for (const int at : table)
        sequence.push_back(static_cast<std::size_t>(std::abs(at) - 1) + (at < 0 ? kPositions : 0));
    return sequence;
}

std::vector<std::size_t> searched(const configuration::Configuration& c) {
    std::vector<plan::Visit> visits;
    std::vector<plan::Row> rows;
    for (const double table_g : c.campaign.table_g) {
        for (const auto& position : c.campaign.positions_deg) {
            visits.push_back({position, table_g * c.estimator.transmission});
            rows.push_back(
                plan::vibration_row(plan::up_at(c.estimator, position), visits.back().level_g));
        }
    }
    const plan::Timing timing{c.campaign.dwell_s, c.campaign.settle_s, c.campaign.ramp_s};
    const double variance = estimator::rate_variance(
        c.estimator, c.campaign.dwell_s, drivers::to_seconds(c.assembler.sample_period));
    estimator::uncertainty::SearchSettings how;
    how.starts = 2;
    how.moves = 3000;
    return estimator::uncertainty::balanced_order(visits, rows, timing, variance, how);
}

}  // namespace

std::vector<std::size_t> visit_sequence(const configuration::Configuration& c) {
    const std::size_t positions = c.campaign.positions_deg.size();
    const std::size_t levels = c.campaign.table_g.size();
    std::vector<std::size_t> sequence(positions * levels);
    std::iota(sequence.begin(), sequence.end(), std::size_t{0});
    switch (c.campaign.order) {
        case VisitOrder::sequential:
            break;
        case VisitOrder::pairs:
            for (std::size_t i = 0; i < sequence.size(); ++i)
                sequence[i] = i % levels * positions + i / levels;
            break;
        case VisitOrder::random: {
            std::mt19937_64 random(kSeed);
            for (std::size_t i = sequence.size(); i > 1; --i)
                std::swap(sequence[i - 1], sequence[random() % i]);
            break;
        }
        case VisitOrder::balanced:
            if (c.campaign.positions_deg == campaign::kTable1Positions && levels == 2)
                return from_table(c.campaign.table_g[1] > 0 ? kTwoLevels : kLevelAndRest);
            return searched(c);
    }
    return sequence;
}

configuration::Loaded put_in_order(configuration::Loaded loaded) {
    auto& c = loaded.configuration;
    if (c.campaign.stops.empty() && !c.campaign.adaptive) c.campaign.sequence = visit_sequence(c);
    return loaded;
}

}  // namespace vibrig
