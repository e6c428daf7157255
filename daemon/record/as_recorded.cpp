#include "daemon/record/as_recorded.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string_view>

#include "daemon/record/campaign_columns.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

/// Where it is looked for first. A recorder that was held up was further away.
constexpr Time kAroundRow = 10 * drivers::kSecond;
/// Looked at in a pause, a row is of the dwell before it.
constexpr Time kAfterDwell = 2 * drivers::kSecond;

/// A column's numbers in one row.
struct ColumnNumbers {
    const char* name;
    std::vector<double> numbers;
};

/// A visitor: numbers that come out of the samples.
struct Collect {
    std::vector<ColumnNumbers>& columns;

    void operator()(const char* name, const auto& field, const char*, const char*,
                    std::initializer_list<std::size_t> = {}) {
        if (std::string_view(name) == "time_ns") return;  // when somebody looked
        ColumnNumbers& column = columns.emplace_back(ColumnNumbers{name, {}});
        for (const auto number : numbers_in(field))
            column.numbers.push_back(static_cast<double>(number));
    }
    void text(const auto&...) {}
};

template <typename... Row>
std::vector<ColumnNumbers> collected(const Row&... row) {
    std::vector<ColumnNumbers> columns;
    (columns_of(row, Collect{columns}), ...);
    return columns;
}

/// To the last bit; and what is not a number is so on both sides.
bool same_bits(double a, double b) {
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

/// All that is compared of a row.
constexpr std::size_t kOfEstimate = 7 + 2 * estimator::kParameters;
std::array<std::uint64_t, kOfEstimate> bits_of(const EstimateRow& row) {
    std::array<std::uint64_t, kOfEstimate> bits{};
    std::size_t at = 0;
    for (const double number : {row.amplitude_g, row.frequency_hz, row.kappa, row.nis_per_dof})
        bits[at++] = std::bit_cast<std::uint64_t>(number);
    for (const std::span<const double> numbers :
         {std::span<const double>(row.innovation_arcsec), std::span<const double>(row.value),
          std::span<const double>(row.sigma)})
        for (const double number : numbers) bits[at++] = std::bit_cast<std::uint64_t>(number);
    return bits;
}

std::uint64_t print_of(const EstimateRow& row) {
    std::uint64_t print = 0xcbf29ce484222325;
    for (const std::uint64_t bits : bits_of(row)) {
        print = (print ^ bits) * 0x9e3779b97f4a7c15;
        print ^= print >> 32;
    }
    return print;
}

std::size_t alike(const EstimateRow& a, const EstimateRow& b) {
    const auto of_a = bits_of(a), of_b = bits_of(b);
    std::size_t count = 0;
    for (std::size_t i = 0; i < kOfEstimate; ++i)
        if (of_a[i] == of_b[i]) ++count;
    return count;
}

/// In words: the first number of a table's row, from 0, that is another one; empty: none.
std::string column_difference(const char* table, std::size_t row,
                              const std::vector<ColumnNumbers>& was,
                              const std::vector<ColumnNumbers>& is) {
    for (std::size_t c = 0; c < std::min(was.size(), is.size()); ++c) {
        const auto &found = was[c].numbers, &again = is[c].numbers;
        for (std::size_t i = 0; i < std::max(found.size(), again.size()); ++i) {
            if (i < found.size() && i < again.size() && same_bits(found[i], again[i])) continue;
            const std::string_view name = was[c].name;
            std::string which;
            if (name == "value" || name == "sigma") {
                which = fmt::format(", {}", estimator::parameter_names()[i]);
            } else if (found.size() > 1) {
                which = fmt::format(", number {}", i + 1);
            }
            const auto text = [i](const std::vector<double>& of) -> std::string {
                if (i >= of.size()) return "nothing";
                return std::isfinite(of[i]) ? fmt::format("{:.17g}", of[i]) : "no number";
            };
            return fmt::format("{}/{}: row {}{}: found {}, the replay gives {}", table, name,
                               row + 1, which, text(found), text(again));
        }
    }
    return {};
}

}  // namespace

std::string dwell_difference(std::size_t row, const Dwell& was, const Dwell& is) {
    std::string words = column_difference("/dwells", row, collected(was), collected(is));
    if (words.empty() && was.numbers)
        words = column_difference("/dwells", row, collected(*was.numbers),
                                  collected(is.numbers.value_or(DwellNumbers{})));
    if (words.empty()) return {};
    return fmt::format("run {} position {}: {}", is.summary.run, is.summary.position, words);
}

std::string row_difference(const Campaign& campaign, std::size_t replayed) {
    // What a daemon that died had not written yet is not there; raw logs have no such rows.
    if (campaign.state != "finished" || campaign.dwells.size() == replayed) return {};
    return fmt::format("/dwells: found {} rows, the replay gives {}", campaign.dwells.size(),
                       replayed);
}

std::string level_difference(const Campaign& campaign, const std::vector<RecordedDwell>& dwells) {
    // The recorder looks once a second, and may see what was commanded shortly before.
    constexpr Time kAtEnds = drivers::kSecond;
    for (const RecordedDwell& dwell : dwells) {
        const Order& order = *dwell.order;
        std::optional<double> commanded;
        for (const ConditionRow& c : campaign.conditions) {
            if (c.time < order.from + kAtEnds || c.time > order.to - kAtEnds) continue;
            commanded = c.command_g;
            if (same_bits(c.command_g, order.table_g)) break;
        }
        if (commanded && !same_bits(*commanded, order.table_g))
            return fmt::format(
                "run {} position {}: /orders/table_g: row {}: found {:g}, expected {:g} as in "
                "/conditions/command_g of its time",
                order.run, order.position, &order - campaign.orders.data() + 1, order.table_g,
                *commanded);
    }
    return {};
}

EstimatesAgain::EstimatesAgain(const Campaign& campaign, const std::vector<RecordedDwell>& dwells)
    : rows_(campaign.estimates) {
    for (const RecordedDwell& dwell : dwells)
        if (dwell.count > 0)
            dwells_.push_back({campaign.samples[dwell.first].time,
                               campaign.samples[dwell.first + dwell.count - 1].time + kAfterDwell});
}

void EstimatesAgain::see(Time time, const estimator::Estimate& e) {
    const EstimateRow state{time,          e.amplitude_g,       e.frequency_hz, e.kappa,
                            e.nis_per_dof, e.innovation_arcsec, e.value,        e.sigma};
    prints_.push_back(print_of(state));
    while (any() && rows_[next_].time < time - kAroundRow) look_at_next();
    if (!any()) return;
    while (!again_.empty() && again_.front().state.time < rows_[next_].time - kAroundRow)
        again_.pop_front();
    again_.push_back({state, prints_.back()});
}

void EstimatesAgain::end() {
    while (any()) look_at_next();
    std::ranges::sort(prints_);
    for (const auto& [row, nearest] : strange_) {
        if (std::ranges::binary_search(prints_, print_of(rows_[row]))) continue;
        if (different_++ == 0)
            first_difference_ =
                column_difference("/estimates", row, collected(rows_[row]), collected(nearest));
    }
}

void EstimatesAgain::look_at_next() {
    const std::size_t number = next_++;
    const EstimateRow& row = rows_[number];
    const bool in_dwell = std::ranges::any_of(dwells_, [&row](const Times& dwell) {
        return row.time >= dwell.from && row.time <= dwell.to;
    });
    if (!in_dwell || again_.empty()) return;
    ++compared_;
    if (std::ranges::find(again_, print_of(row), &Seen::print) != again_.end()) return;
    const auto nearest = std::ranges::max_element(
        again_, {}, [&row](const Seen& one) { return alike(row, one.state); });
    strange_.emplace_back(number, nearest->state);
}

}  // namespace vibrig::record
