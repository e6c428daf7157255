#include "daemon/interlock/random_bands.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace vibrig::rt {
namespace {

/// One look in 1e9 of a normal deviate.
constexpr double kOnceIn1e9 = 5.9978;
/// Values that a mean needs to stray by so much once in 1e9 looks, and the least time of each rule.
constexpr double kFarAboveValues = 22, kAboveValues = 117, kBelowValues = 190;
constexpr double kAboveLeast_s = 0.6, kBelowLeast_s = 1;

double power_of(double decibels) noexcept { return std::pow(10, decibels / 10); }

/// Quantile of chi-square over its n degrees of freedom (Wilson and Hilferty).
double chi_square_mean(double n, double deviate) noexcept {
    const double spread = 2 / (9 * n);
    return std::pow(std::max(0.0, 1 - spread + deviate * std::sqrt(spread)), 3);
}

RandomBands::Rule rule_of(RandomBands::Finding finding, double decibels, double values,
                          double least_s, const RandomBands::Settings& s) {
    const double a_second = std::min(s.sample_hz, 2 * s.bandwidth_hz);
    RandomBands::Rule rule{finding, decibels, std::max(least_s, values / a_second), 0, 0, 0};
    rule.values = static_cast<std::size_t>(std::max(2.0, std::round(rule.window_s * s.sample_hz)));
    rule.independent = rule.window_s * a_second;
    rule.threshold = RandomBands::threshold(decibels, rule.independent);
    return rule;
}

}  // namespace

double RandomBands::threshold(double decibels, double n) noexcept {
    const double wrong = power_of(decibels);
    if (decibels > 0) {
        const double by_chance = chi_square_mean(n, kOnceIn1e9);
        const double missed = wrong * chi_square_mean(n, -kOnceIn1e9);
        return std::min(wrong, std::max(by_chance, std::sqrt(by_chance * missed)));
    }
    const double by_chance = chi_square_mean(n, -kOnceIn1e9);
    const double missed = wrong * chi_square_mean(n, kOnceIn1e9);
    return std::max(wrong, std::min(by_chance, std::sqrt(by_chance * missed)));
}

RandomBands::RandomBands(const Settings& s) : mean_square_(s.mean_square) {
    for (const double value : {s.sample_hz, s.bandwidth_hz, s.mean_square}) {
        if (!(value > 0))
            throw std::invalid_argument(
                "abort bands: sample rate, bandwidth and mean square: "
                "found " +
                std::to_string(value) + ", expected above 0");
    }
    rules_ = {rule_of(Finding::far_above, 6, kFarAboveValues, kAboveLeast_s, s),
              rule_of(Finding::above, 3, kAboveValues, kAboveLeast_s, s),
              rule_of(Finding::below, -3, kBelowValues, kBelowLeast_s, s)};
    std::size_t longest = 0;
    for (const Rule& rule : rules_) longest = std::max(longest, rule.values);
    squares_.resize(longest);
}

std::array<double, 2> RandomBands::by_chance(double n) noexcept {
    return {chi_square_mean(n, -kOnceIn1e9), chi_square_mean(n, kOnceIn1e9)};
}

void RandomBands::begin() noexcept {
    sums_ = {};
    next_ = count_ = below_from_ = 0;
    below_ = true;
    judged_ = 0;
}

void RandomBands::watch_below(bool watch) noexcept {
    if (watch && !below_) below_from_ = count_;
    below_ = watch;
}

RandomBands::Finding RandomBands::add(double acceleration) noexcept {
    const double square = acceleration * acceleration;
    // A reading that is no number is wrong, and not forgotten.
    if (!std::isfinite(square)) {
        judged_ = square;
        return Finding::far_above;
    }
    const std::size_t size = squares_.size();
    for (std::size_t r = 0; r < rules_.size(); ++r) {
        sums_[r] += square;
        if (count_ >= rules_[r].values)
            sums_[r] -= squares_[(next_ + size - rules_[r].values) % size];
    }
    squares_[next_] = square;
    next_ = (next_ + 1) % size;
    ++count_;
    // Rounding errors do not add up for hours.
    if (next_ == 0) {
        for (std::size_t r = 0; r < rules_.size(); ++r) {
            const std::size_t n = std::min(count_, rules_[r].values);
            sums_[r] = 0;
            for (std::size_t i = 0; i < n; ++i) sums_[r] += squares_[size - 1 - i];
        }
    }
    for (std::size_t r = 0; r < rules_.size(); ++r) {
        const Rule& rule = rules_[r];
        const bool below = rule.decibels < 0;
        if (count_ < rule.values + (below ? below_from_ : 0) || (below && !below_)) continue;
        const double is = sums_[r] / (static_cast<double>(rule.values) * mean_square_);
        if (below ? is >= rule.threshold : is <= rule.threshold) continue;
        judged_ = is;
        return rule.finding;
    }
    return Finding::none;
}

double RandomBands::ratio() const noexcept {
    const std::size_t r = count_ >= rules_[1].values ? 1 : 0;
    const auto values = static_cast<double>(rules_[r].values);
    return count_ < rules_[r].values ? 0 : sums_[r] / (values * mean_square_);
}

}  // namespace vibrig::rt
