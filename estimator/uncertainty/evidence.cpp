#include <algorithm>
#include <cmath>

#include "estimator/filter/linear_algebra.hpp"

#include "estimator/uncertainty/fit.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<double, 3> kSizes{1, 4, 16};
constexpr double kLargestSize = 16;
/// Of F: unknowns, or combinations of them, of which the data say nothing.
constexpr double kLeastEigenvalue = 1e-3, kLeastShare = 1e-9;
/// So many sigma a misfit must be to be seen with 90 %.
constexpr double kSeen = 4.2;
constexpr Index kMostTried = 120;

double log_mean(const std::vector<double>& logs) {
    const double largest = *std::max_element(logs.begin(), logs.end());
    double sum = 0;
    for (const double one : logs) sum += std::exp(one - largest);
    return largest + std::log(sum / static_cast<double>(logs.size()));
}

/// Logarithms of the odds for each size of the unknowns' prior.
std::vector<double> log_odds(const NullFit::Projection& of) {
    const auto [values, vectors] = linear_algebra::symmetric_eigen(of.f);
    const VectorXd s = vectors.transpose() * of.s;
    const double least = std::max(kLeastEigenvalue, kLeastShare * values.maxCoeff());
    std::vector<double> logs;
    for (const double q : kSizes) {
        double sum = 0;
        for (Index i = 0; i < s.size(); ++i) {
            const double f = values[i];
            if (f < least) continue;
            sum += -0.5 * std::log1p(q * q * f) + 0.5 * s[i] * s[i] / (f + 1 / (q * q));
        }
        logs.push_back(sum);
    }
    return logs;
}

void take_size(Evidence& out, const Signatures& of, const NullFit& fit,
               const NullFit::Projection& projection) {
    MatrixXd information = projection.f;
    information.diagonal().array() += 1 / (kLargestSize * kLargestSize);
    const MatrixXd covariance = linear_algebra::positive_inverse(information);
    const VectorXd p = covariance * projection.s;
    out.elements = of.elements;
    out.unit = of.unit;
    out.rates = of.z * p;
    out.change = fit.change(out.rates);
    out.size.clear();
    out.sigma.clear();
    for (Index i = 0; i < p.size(); ++i) {
        out.size.push_back(of.size * p[i]);
        out.sigma.push_back(of.size * std::sqrt(covariance(i, i)));
    }
    out.smallest_seen =
        kSeen * of.size / std::sqrt(std::max(projection.f.diagonal().maxCoeff(), 1e-300));
}

/// A step at any place from `first` to n - first.
Evidence weigh_steps(Pattern pattern, int first, const DwellTable& table, const NullFit& fit,
                     const ForwardModel& model, double s0) {
    Evidence out;
    out.pattern = pattern;
    std::vector<double> logs;
    double best = -1e300;
    const Index last = table.dwells() - first;
    const Index stride = std::max<Index>(1, (last - first + 1) / kMostTried * 3);
    for (Index k = first; k <= last; k += stride) {
        const Signatures of = signatures(pattern, table, model, s0, static_cast<int>(k));
        const auto projection = fit.project(of.z);
        const std::vector<double> here = log_odds(projection);
        logs.insert(logs.end(), here.begin(), here.end());
        if (const double mean = log_mean(here); mean > best) {
            best = mean;
            out.after_dwell = static_cast<int>(k);
            take_size(out, of, fit, projection);
        }
    }
    out.log_odds = logs.empty() ? 0 : log_mean(logs);
    return out;
}

/// One size for all gyros, and each gyro by itself with even odds of none, as likely.
template <class Ratio>
double log_odds_of(const std::array<GyroRates, 3>& gyros, const std::array<double, 5>& sizes,
                   const Ratio& ratio) {
    std::vector<double> together(sizes.size(), 0.0);
    double apart = 0;
    for (const GyroRates& gyro : gyros) {
        const DriftLikelihood likelihood(gyro);
        std::vector<double> logs;
        for (std::size_t i = 0; i < sizes.size(); ++i) {
            logs.push_back(ratio(likelihood, sizes[i]));
            together[i] += logs.back();
        }
        apart += log_mean({0.0, log_mean(logs)});
    }
    return log_mean({log_mean(together), apart});
}

Evidence of_state(Pattern pattern, double odds, const char* unit) {
    Evidence out;
    out.pattern = pattern;
    out.log_odds = odds;
    out.unit = unit;
    return out;
}

/// By the chi-square alone; of a mean of squares the relative error is sqrt(2 / nu).
void take_scatter(Evidence& out, const NullFit& fit, double s0) {
    const double nu = std::max(1, fit.degrees()), mean = fit.chi_square() / nu;
    const double size = s0 * std::sqrt(std::max(mean - 1, 0.5 * std::sqrt(2 / nu)));
    out.elements = {""};
    out.size = {mean > 1 ? size : 0};
    out.sigma = {s0 * s0 * mean * std::sqrt(2 / nu) / (2 * size)};
}

}  // namespace

const char* name_of(Pattern pattern) noexcept {
    static constexpr std::array<const char*, kPatterns - kStructuralNames.size()> kOfStates{
        "trend",
        "step",
        "walk",
        "scatter",
        "mass unbalance trend",
        "mass unbalance step",
        "ramp within dwells",
        "gyro noise"};
    const auto i = static_cast<std::size_t>(pattern);
    return i < kStructuralNames.size() ? kStructuralNames[i]
                                       : kOfStates[i - kStructuralNames.size()];
}

Evidence weigh(Pattern pattern, const Signatures& of, const NullFit& fit) {
    Evidence out;
    out.pattern = pattern;
    const auto projection = fit.project(of.z);
    out.log_odds = log_mean(log_odds(projection));
    take_size(out, of, fit, projection);
    return out;
}

double log_occam(const Signatures& of, const NullFit& fit, const Evidence& found) {
    const auto [values, vectors] = linear_algebra::symmetric_eigen(fit.project(of.z).f);
    VectorXd sizes(of.z.cols());
    for (Index i = 0; i < sizes.size(); ++i)
        sizes[i] = found.size[static_cast<std::size_t>(i)] / of.size;
    const VectorXd p = vectors.transpose() * sizes;
    const double least = std::max(kLeastEigenvalue, kLeastShare * values.maxCoeff());
    std::vector<double> logs;
    for (const double q : kSizes) {
        double sum = 0;
        for (Index i = 0; i < p.size(); ++i) {
            if (values[i] < least) continue;
            sum -=
                0.5 * std::log1p(q * q * values[i]) + 0.5 * p[i] * p[i] / (q * q + 1 / values[i]);
        }
        logs.push_back(sum);
    }
    return log_mean(logs);
}

bool is_structural(Pattern pattern) noexcept { return pattern <= Pattern::cubic; }

std::vector<Evidence> weigh_patterns(const DwellTable& table, const NullFit& fit,
                                     const RampFit& ramps, const ForwardModel& model,
                                     const std::array<GyroRates, 3>& gyros) {
    double variance = 0;
    for (const GyroRates& gyro : gyros) variance += std::pow(unit_of(gyro.variance), 2) / 3.0;
    const double s0 = std::sqrt(variance);
    std::vector<Evidence> all;
    constexpr std::array kOne{
        Pattern::cross_axis, Pattern::azimuth,      Pattern::latitude,
        Pattern::time_base,  Pattern::encoder_zero, Pattern::non_orthogonality,
        Pattern::resolver_1, Pattern::resolver_2,   Pattern::resolver_16,
        Pattern::cubic,      Pattern::trend,        Pattern::unbalance_trend};
    for (const Pattern pattern : kOne)
        all.push_back(weigh(pattern, signatures(pattern, table, model, s0), fit));
    all.push_back(weigh_steps(Pattern::step, 2, table, fit, model, s0));
    all.push_back(weigh_steps(Pattern::unbalance_step, 3, table, fit, model, s0));
    Evidence scatter = of_state(Pattern::scatter,
                                log_odds_of(gyros, {0.5, 1, 2, 4, 8},
                                            [](const DriftLikelihood& of, double size) {
                                                return of.ratio_of_scatter(size);
                                            }),
                                "deg/h");
    take_scatter(scatter, fit, s0);
    all.push_back(std::move(scatter));
    all.push_back(of_state(
        Pattern::walk,
        log_odds_of(gyros, {2, 4, 8, 16, 32},
                    [](const DriftLikelihood& of, double size) { return of.ratio_of_walk(size); }),
        "deg/h"));

    Evidence ramp = of_state(Pattern::ramp, ramps.log_evidence(), "deg/h per 100 s");
    ramp.elements = {"x", "y", "z"};
    ramp.size.assign(ramps.mean.begin(), ramps.mean.end());
    ramp.sigma.assign(ramps.sigma.begin(), ramps.sigma.end());
    ramp.smallest_seen = kSeen * *std::min_element(ramps.sigma.begin(), ramps.sigma.end());
    all.push_back(std::move(ramp));

    const double freedom = fit.degrees() + 3.0 * static_cast<double>(table.dwells());
    const double chi = fit.chi_square() + ramps.chi_square;
    const double lambda = chi / freedom;
    Evidence noise = of_state(
        Pattern::gyro_noise,
        0.5 * (chi * (1 - 1 / lambda) - freedom * std::log(lambda)) - 0.5 * std::log(freedom), "");
    noise.size = {std::sqrt(lambda)};
    noise.sigma = {std::sqrt(lambda / (2 * freedom))};
    all.push_back(std::move(noise));

    std::stable_sort(all.begin(), all.end(),
                     [](const Evidence& a, const Evidence& b) { return a.log_odds > b.log_odds; });
    return all;
}

}  // namespace vibrig::estimator::uncertainty
