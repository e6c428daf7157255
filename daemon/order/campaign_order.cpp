#include "daemon/order/campaign_order.hpp"

#include <algorithm>
#include <array>
#include <cmath>
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

void shuffle(std::vector<std::size_t>& sequence) {
    std::mt19937_64 random(kSeed);
    for (std::size_t i = sequence.size(); i > 1; --i)
        std::swap(sequence[i - 1], sequence[random() % i]);
}

plan::Timing timing_of(const configuration::Configuration& c) {
    return {c.campaign.dwell_s, c.campaign.settle_s, c.campaign.ramp_s};
}

double variance_of(const configuration::Configuration& c) {
    return estimator::rate_variance(c.estimator, c.campaign.dwell_s,
                                    drivers::to_seconds(c.assembler.sample_period));
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
    estimator::uncertainty::SearchSettings how;
    how.starts = 2;
    how.moves = 3000;
    return estimator::uncertainty::balanced_order(visits, rows, timing_of(c), variance_of(c), how);
}

/// Of a stop: six quadratic coefficients for each kind of vibration but the reference frequency,
/// which has the ten with gravity's.
class KindRows {
  public:
    explicit KindRows(const configuration::Configuration& c) : c_(c) {
        for (const auto& stop : c.campaign.stops) {
            if (!stop.verify && !stop.sweep.any() && !at_reference(stop) &&
                place(stop.kind()) == kinds_.size())
                kinds_.push_back(stop.kind());
        }
    }

    [[nodiscard]] plan::Visit visit(const campaign::Stop& stop) const {
        if (stop.random)
            return {stop.position_deg, std::sqrt(2 * stop.random->at_platform.mean_square_g2)};
        const double ratio = stop.transmission > 0 ? stop.transmission : c_.estimator.transmission;
        return {stop.position_deg, stop.table_g * ratio};
    }
    [[nodiscard]] Eigen::RowVectorXd row(const campaign::Stop& stop) const {
        constexpr auto kAll = static_cast<Eigen::Index>(plan::kTerms);
        Eigen::RowVectorXd out =
            Eigen::RowVectorXd::Zero(kAll + kQuadratic * static_cast<Eigen::Index>(kinds_.size()));
        const auto up = plan::up_at(c_.estimator, stop.position_deg);
        const double level_g = visit(stop).level_g;
        const bool reference = at_reference(stop);
        const auto base = plan::vibration_row(up, reference ? level_g : 0);
        for (Eigen::Index k = 0; k < kAll; ++k) out[k] = base[static_cast<std::size_t>(k)];
        if (!reference)
            out.segment(kAll + kQuadratic * static_cast<Eigen::Index>(place(stop.kind())),
                        kQuadratic) =
                (plan::kappa_of(level_g) - 1) * out.segment(kAll - kQuadratic, kQuadratic);
        return out;
    }

  private:
    static constexpr Eigen::Index kQuadratic = 6;

    [[nodiscard]] bool at_reference(const campaign::Stop& stop) const {
        return !stop.random && (!(stop.table_g > 0) || !(stop.frequency_hz > 0) ||
                                estimator::at_reference(c_.estimator, stop.frequency_hz));
    }
    [[nodiscard]] std::size_t place(double kind) const {
        return static_cast<std::size_t>(std::ranges::find(kinds_, kind) - kinds_.begin());
    }

    const configuration::Configuration& c_;
    std::vector<double> kinds_;
};

/// A plan's dwells, no kind of vibration early or late; those held out, of which the coefficients
/// take nothing, evenly among them.
std::vector<campaign::Stop> balanced(const configuration::Configuration& c) {
    std::vector<campaign::Stop> fitted, held_out;
    std::vector<campaign::Stop> out;  // sweeps first: they determine nothing by themselves
    for (const auto& stop : c.campaign.stops)
        (stop.sweep.any() ? out : stop.verify ? held_out : fitted).push_back(stop);
    const KindRows kinds(c);
    std::vector<plan::Visit> visits;
    Eigen::MatrixXd rows;
    for (const auto& stop : fitted) {
        visits.push_back(kinds.visit(stop));
        const Eigen::RowVectorXd row = kinds.row(stop);
        rows.conservativeResize(static_cast<Eigen::Index>(visits.size()), row.size());
        rows.bottomRows<1>() = row;
    }
    estimator::uncertainty::SearchSettings how;
    how.starts = 1;
    const plan::Order order =
        estimator::uncertainty::balanced_order(visits, rows, timing_of(c), variance_of(c), how);
    for (const std::size_t i : order) out.push_back(fitted[i]);
    for (std::size_t i = 0; i < held_out.size(); ++i) {
        const std::size_t at = (2 * i + 1) * c.campaign.stops.size() / (2 * held_out.size());
        out.insert(out.begin() + static_cast<std::ptrdiff_t>(std::min(at, out.size())),
                   held_out[i]);
    }
    return out;
}

void order_stops(configuration::Configuration& c) {
    auto& stops = c.campaign.stops;
    if (c.campaign.order == VisitOrder::balanced) stops = balanced(c);
    if (c.campaign.order != VisitOrder::random) return;
    std::vector<std::size_t> sequence(stops.size());
    std::iota(sequence.begin(), sequence.end(), std::size_t{0});
    shuffle(sequence);
    std::vector<campaign::Stop> out;
    for (const std::size_t i : sequence) out.push_back(stops[i]);
    stops = std::move(out);
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
        case VisitOrder::random:
            shuffle(sequence);
            break;
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
    // A plan is in an order already: only where another one is stated it is not kept.
    const auto stated = std::ranges::any_of(loaded.effective, [](const auto& value) {
        return value.key == "campaign.order" && value.origin != "default";
    });
    if (!c.campaign.stops.empty() && stated) order_stops(c);
    return loaded;
}

}  // namespace vibrig
