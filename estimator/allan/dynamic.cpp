#include "estimator/allan/dynamic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/allan/deviation.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr std::size_t kShortestWindow = 9;
constexpr std::size_t kGrid = 20;
constexpr double kMostMissing = 0.1;

std::size_t checked_window(std::size_t window) {
    if (window < kShortestWindow) {
        throw DataError("window: " + std::to_string(window) + " samples found, at least " +
                        std::to_string(kShortestWindow) + " needed");
    }
    return window;
}

std::vector<VariancePoint> curve_of(const std::vector<double>& allan,
                                    const std::vector<double>& share,
                                    const std::vector<std::size_t>& factors, double tau0) {
    std::vector<VariancePoint> curve;
    for (std::size_t k = 0; k < factors.size(); ++k) {
        if (allan[k] > 0) {
            curve.push_back(
                {static_cast<double>(factors[k]) * tau0, factors[k], allan[k], share[k]});
        }
    }
    return curve;
}

std::uint64_t checked_hop(const DynamicSettings& settings) {
    if (!(settings.overlap >= 0 && settings.overlap < 1)) {
        throw DataError("overlap: must be at least 0 and below 1, got " +
                        std::to_string(settings.overlap));
    }
    // 1 - 0.9 is a hair less than a tenth.
    constexpr double kRounding = 1e-12;
    const double hop =
        static_cast<double>(settings.window) * (1 - settings.overlap) * (1 + kRounding);
    return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(hop));
}

}  // namespace

std::vector<std::size_t> window_factors(std::size_t window) {
    std::vector<std::size_t> factors = log_factors(window / 3, kGrid);
    const std::vector<std::size_t> octaves = octave_factors(window / 4);
    factors.insert(factors.end(), octaves.begin(), octaves.end());
    std::sort(factors.begin(), factors.end());
    factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
    return factors;
}

DynamicAllan::DynamicAllan(const DynamicSettings& settings)
    : settings_(settings),
      sliding_(settings.tau0, checked_window(settings.window), window_factors(settings.window)),
      covariance_(sliding_.factors(), settings.window + 1, settings.tau0),
      hop_(checked_hop(settings)) {}

bool DynamicAllan::add(double rate) noexcept {
    sliding_.add(rate);
    return sliding_.full() && (sliding_.samples() - settings_.window) % hop_ == 0;
}

WindowRow DynamicAllan::row() const {
    WindowRow row;
    const double tau0 = settings_.tau0;
    const std::vector<std::size_t>& factors = sliding_.factors();
    row.begin_s = static_cast<double>(sliding_.samples() - settings_.window) * tau0;
    row.centre_s = row.begin_s + 0.5 * static_cast<double>(settings_.window) * tau0;
    row.mean = sliding_.mean();
    row.missing = sliding_.missing();
    const double centre = settings_.mode == MeanMode::known_mean ? settings_.known_mean : row.mean;
    std::vector<ClassicalPoint> classical;
    for (std::size_t k = 0; k < factors.size(); ++k) {
        row.allan.push_back(sliding_.allan(k, settings_.shape));
        row.share.push_back(sliding_.share(k) * share_of(settings_.shape));
        const double tau = static_cast<double>(factors[k]) * tau0;
        if (settings_.mode == MeanMode::corrected) {
            const SlidingVariance::Tiled tiled = sliding_.tiled(k);
            row.classical.push_back(tiled.variance);
            if (tiled.variance > 0) {
                classical.push_back(
                    {tau, tiled.variance, static_cast<double>(tiled.covered) * tau0});
            }
        } else {
            row.classical.push_back(sliding_.classical(k, centre));
            if (row.classical[k] > 0) {
                classical.push_back({tau, row.classical[k], 0});
            }
        }
    }
    const std::vector<VariancePoint> curve = curve_of(row.allan, row.share, factors, tau0);
    row.refused =
        static_cast<double>(row.missing) > kMostMissing * static_cast<double>(settings_.window) ||
        curve.size() < 2 || classical.size() < kPowers.size();
    if (!row.refused) {
        if (settings_.fits) row.fit = fit_noise(curve, covariance_, settings_.wanted);
        row.classical_fit = fit_classical(classical, settings_.mode);
    }
    return row;
}

DynamicSummary summarise(const DynamicAllan& dynamic, const std::vector<WindowRow>& rows) {
    DynamicSummary summary;
    const std::vector<std::size_t>& factors = dynamic.factors();
    const DynamicSettings& settings = dynamic.settings();
    std::vector<double> allan(factors.size(), 0.0);
    std::vector<double> share(factors.size(), 0.0);
    Polynomial a{};
    for (const WindowRow& row : rows) {
        if (row.refused) {
            ++summary.refused;
            continue;
        }
        ++summary.windows;
        for (std::size_t k = 0; k < factors.size(); ++k) {
            // A window in which gaps leave no difference says nothing of that averaging time.
            if (!(row.share[k] > 0)) continue;
            allan[k] += row.share[k] * row.allan[k];
            share[k] += row.share[k];
        }
        for (std::size_t k = 0; k < a.size(); ++k) {
            a[k] += row.classical_fit.a[k];
        }
    }
    summary.faults = dynamic.faults();
    if (summary.windows == 0) {
        return summary;
    }
    const auto n = static_cast<double>(summary.windows);
    for (std::size_t k = 0; k < factors.size(); ++k) {
        if (share[k] > 0) allan[k] /= share[k];
        // Degrees of freedom add over the time covered, not over windows that share samples.
        share[k] *= 1 - settings.overlap * (n - 1) / n;
    }
    for (double& coefficient : a) {
        coefficient /= n;
    }
    const double tau0 = settings.tau0;
    summary.fit =
        fit_noise(curve_of(allan, share, factors, tau0), dynamic.covariance(), settings.wanted);
    const double shortest = tau0;
    const double longest = static_cast<double>(factors.back()) * tau0;
    summary.classical = interpret(a, settings.mode == MeanMode::known_mean, shortest, longest);
    if (settings.mode == MeanMode::window_mean) {
        summary.classical.terms[static_cast<std::size_t>(Term::B)] =
            rows.empty() || a[0] < 0 ? std::numeric_limits<double>::quiet_NaN()
                                     : std::sqrt(a[0]) / 0.664;
    }
    return summary;
}

}  // namespace vibrig::estimator::allan
