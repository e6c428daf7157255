#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "estimator/identification/identification_impl.hpp"

namespace vibrig::estimator {
namespace {

constexpr double kHannNoiseBandwidth = 1.5;

/// Of dwells at one vibration, or at rest, kappa is the same but for the rig's scatter.
constexpr double kOneLevelOfRun = 1.25;

/// Least and largest amplitude of a run whose dwells are at several levels of one vibration.
std::optional<std::pair<double, double>> several_levels(const std::vector<DwellSummary>& dwells,
                                                        int run) {
    constexpr double kOneFrequency = 1.01;
    double least = 0, largest = 0, least_hz = 0, largest_hz = 0;
    for (const DwellSummary& d : dwells) {
        // Neither random vibration nor a sweep has a line.
        const bool sine = d.frequency_hz > 0;
        if (d.run != run || d.used == 0 || !(sine || d.kappa - 1 < VibrationLevel::kAtRest))
            continue;
        least = least > 0 ? std::min(least, d.kappa) : d.kappa;
        largest = std::max(largest, d.kappa);
        if (!sine) continue;
        least_hz = least_hz > 0 ? std::min(least_hz, d.frequency_hz) : d.frequency_hz;
        largest_hz = std::max(largest_hz, d.frequency_hz);
    }
    if (largest <= kOneLevelOfRun * least || largest_hz > kOneFrequency * least_hz) return {};
    const auto amplitude = [](double kappa) { return std::sqrt(2.0 * std::max(0.0, kappa - 1.0)); };
    return std::pair{amplitude(least), amplitude(largest)};
}

/// Per run: mean over its dwells; sigma from accelerometer noise with the gain calibrated by
/// gravity, sigma_a sqrt((2 + a0^2) / n), and from the scatter of the dwells.
std::vector<RunAmplitude> amplitudes_of(const std::vector<DwellSummary>& dwells, double noise_g) {
    std::vector<RunAmplitude> runs;
    std::vector<int> numbers;
    for (const DwellSummary& d : dwells) {
        if (std::find(numbers.begin(), numbers.end(), d.run) == numbers.end())
            numbers.push_back(d.run);
    }
    std::sort(numbers.begin(), numbers.end());
    for (const int number : numbers) {
        RunAmplitude run;
        run.run = number;
        double n = 0, kappa = 0, kappa_square = 0, frequency = 0, vibrating = 0, samples = 0;
        for (const DwellSummary& d : dwells) {
            if (d.run != number || d.used == 0) continue;
            n += 1;
            kappa += d.kappa;
            kappa_square += d.kappa * d.kappa;
            samples += d.samples;
            if (d.frequency_hz > 0) {
                frequency += d.frequency_hz;
                vibrating += 1;
            }
        }
        if (n == 0) continue;
        run.kappa = kappa / n;
        // A mean of levels is none that there was.
        run.amplitude_g = several_levels(dwells, number)
                              ? std::numeric_limits<double>::quiet_NaN()
                              : std::sqrt(2.0 * std::max(0.0, run.kappa - 1.0));
        run.frequency_hz = vibrating > 0 ? frequency / vibrating : 0.0;
        if (run.amplitude_g > 0) {
            const double scatter =
                std::max(0.0, kappa_square / n - run.kappa * run.kappa) / run.kappa;
            // d a0 = d kappa / a0
            const double of_dwells =
                n > 1 ? scatter * run.kappa / ((n - 1) * run.amplitude_g * run.amplitude_g) : 0.0;
            const double of_noise = noise_g * noise_g * kHannNoiseBandwidth *
                                    (2.0 + run.amplitude_g * run.amplitude_g) / samples;
            run.sigma_g = std::sqrt(of_dwells + of_noise);
        }
        runs.push_back(run);
    }
    return runs;
}

std::string dwell_name(const DwellSummary& d) {
    return "run " + std::to_string(d.run) + " position " + std::to_string(d.position) + ": ";
}

std::vector<std::string> dwell_warnings(const std::vector<DwellSummary>& dwells) {
    std::vector<std::string> warnings;
    for (const DwellSummary& d : dwells) {
        if (d.flagged) {
            std::string text = dwell_name(d) + d.reason;
            text += " (";
            if (d.mean_force_g > 0)
                text += "mean vertical force " + std::to_string(d.mean_force_g) + " g, ";
            text += std::to_string(d.rejected) + " of " + std::to_string(d.samples) +
                    " samples rejected)";
            warnings.push_back(std::move(text));
        }
        if (d.used < 2 || d.nis_per_dof <= 0) continue;  // a sweep is not the filter's
        // 99.9 % band of a mean of chi-squares, where the dwell is too short for 10 %.
        const double band = std::max(0.1, 3.29 * std::sqrt(2.0 / (3.0 * d.used)));
        if (std::abs(d.nis_per_dof - 1.0) > band) {
            warnings.push_back(dwell_name(d) + "normalised innovation squared is " +
                               std::to_string(d.nis_per_dof) +
                               " per degree of freedom, expected 1 within " + std::to_string(band) +
                               ": noise other than configured, or angles that move otherwise "
                               "than gyros and Earth let them (the verdict names what fits)");
        }
        // Three axes a sample; 4 standard deviations of a correlation of white noise.
        const double white = std::max(0.1, 4.0 / std::sqrt(3.0 * d.used));
        if (std::abs(d.innovation_correlation) > white) {
            warnings.push_back(dwell_name(d) + "innovations are correlated by " +
                               std::to_string(d.innovation_correlation) +
                               " from one sample to the next, expected 0 within " +
                               std::to_string(white) +
                               ": the noise of the readings is not white, sigma is too small");
        }
    }
    return warnings;
}

std::string unobservable_warning(const std::array<bool, kParameters>& observable) {
    std::string names;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (!observable[i]) names += std::string(names.empty() ? "" : " ") + parameter_names()[i];
    }
    return names.empty() ? names
                         : "not determined one by one by these positions and levels: " + names;
}

}  // namespace

bool RunAmplitude::at_rest() const noexcept { return kappa - 1 < VibrationLevel::kAtRest; }

std::vector<DwellRow> without_apart(const std::vector<DwellRow>& rows) {
    std::vector<DwellRow> out;
    out.reserve(rows.size());
    std::ranges::copy_if(rows, std::back_inserter(out),
                         [](const DwellRow& row) { return !row.apart; });
    return out;
}

void widen_amplitudes(Result& result, const std::vector<std::pair<int, double>>& level_variances) {
    for (RunAmplitude& amplitude : result.amplitudes) {
        double sum = 0;
        std::size_t n = 0;
        for (const auto& [run, variance] : level_variances) {
            if (run != amplitude.run) continue;
            sum += variance;
            ++n;
        }
        if (n == 0) continue;
        amplitude.sigma_g = std::hypot(
            amplitude.sigma_g, amplitude.amplitude_g * std::sqrt(sum / static_cast<double>(n)));
    }
}

bool Identification::Impl::two_runs() const noexcept {
    return filters[0].kappa.dwells > 0 && filters[1].kappa.dwells > 0;
}

void Identification::Impl::solve(Solution& out) const noexcept {
    const auto take = [](const DriftFilter& filter, ParameterArray& value, Covariance& covariance) {
        std::copy_n(filter.state().constants(), kParameters, value.begin());
        filter.state().covariance(covariance.data());
    };
    if (settings.method == Method::joint) {
        if (!filters[0].batch.solve(out.value, out.covariance))
            take(filters[0].filter, out.value, out.covariance);
        out.found = observability(out.covariance, prior, filters[0].kappa);
        return;
    }
    out.found = {};
    out.found.undetermined = kParameters;
    out.found.directions.setIdentity();
    take(filters[0].filter, out.value, out.covariance);
    if (!two_runs() || refused_run) return;
    RunSolution first, second, joined;
    take(filters[0].filter, first.value, first.covariance);
    take(filters[1].filter, second.value, second.covariance);
    first.kappa = filters[0].kappa.mean;
    second.kappa = filters[1].kappa.mean;
    KappaSpread spread;
    spread.add(first.kappa);
    spread.add(second.kappa);
    if (spread.one_level() || !recover(first, second, joined)) return;
    out.value = joined.value;
    out.covariance = joined.covariance;
    out.found = observability(joined.covariance, prior, spread);
}

bool Identification::Impl::batch_solution(RunSolution& out) const noexcept {
    if (settings.method == Method::joint) {
        return filters[0].kappa.dwells > 0 &&
               filters[0].batch.solve(out.value, out.covariance, BatchSolver::Bias::now);
    }
    RunSolution first, second;
    first.kappa = filters[0].kappa.mean;
    second.kappa = filters[1].kappa.mean;
    return two_runs() && !refused_run && filters[0].batch.solve(first.value, first.covariance) &&
           filters[1].batch.solve(second.value, second.covariance) && recover(first, second, out);
}

CrossCheck Identification::Impl::cross_check(const std::vector<Combination>& combinations) const {
    CrossCheck check;
    RunSolution batch;
    if (!batch_solution(batch)) return check;
    // What the filter says: of biases that walk, as they are now.
    RunSolution mine;
    mine.value = solution.value;
    mine.covariance = solution.covariance;
    if (settings.method == Method::joint) {
        const UdFilter& state = filters[0].filter.state();
        std::copy_n(state.constants(), kParameters, mine.value.begin());
        state.covariance(mine.covariance.data());
    }
    const auto compare = [&check](const std::string& name, double difference, double sigma) {
        // Written so that what is not a number is the largest difference there is.
        const double in_sigma = std::abs(difference) / sigma;
        check.done = true;
        if (in_sigma <= check.largest) return;
        check.largest = std::isfinite(in_sigma) ? in_sigma : std::numeric_limits<double>::max();
        check.coefficient = name;
    };
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t a = internal_of(i);
        if (!solution.found.observable[a]) continue;
        const auto k = static_cast<Eigen::Index>(a);
        compare(parameter_names()[i], batch.value[a] - mine.value[a],
                std::sqrt(mine.covariance(k, k)));
    }
    for (const Combination& combination : combinations) {
        double difference = 0;
        for (const auto& [name, weight] : combination.weights) {
            for (std::size_t i = 0; i < kParameters; ++i) {
                const std::size_t a = internal_of(i);
                if (name == parameter_names()[i])
                    difference += weight * (batch.value[a] - mine.value[a]);
            }
        }
        compare(combination.weights.front().first, difference, combination.sigma);
    }
    return check;
}

Result Identification::Impl::result() const {
    Result out;
    const double none = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t a = internal_of(i);
        out.observable[i] = solution.found.observable[a];
        const auto ka = static_cast<Eigen::Index>(a);
        out.value[i] = out.observable[i] ? solution.value[a] : none;
        out.sigma[i] =
            out.observable[i] ? std::sqrt(std::max(0.0, solution.covariance(ka, ka))) : none;
        for (std::size_t j = 0; j < kParameters; ++j) {
            const std::size_t b = internal_of(j);
            const bool both = solution.found.observable[a] && solution.found.observable[b];
            out.covariance[i][j] =
                both ? solution.covariance(ka, static_cast<Eigen::Index>(b)) : none;
        }
    }
    out.combinations =
        determined_combinations(solution.found, solution.covariance, solution.value, prior);
    out.amplitudes = amplitudes_of(dwells, settings.accelerometer_g);
    out.warnings = dwell_warnings(dwells);
    for (const RunAmplitude& run : out.amplitudes)
        if (const auto levels = several_levels(dwells, run.run))
            out.warnings.push_back("run " + std::to_string(run.run) + ": found dwells from " +
                                   std::to_string(levels->first) + " to " +
                                   std::to_string(levels->second) +
                                   " g under one run number, expected one level: no amplitude is "
                                   "given; coefficients take each dwell with its own");
    out.nis_per_dof = nis_count > 0 ? nis_sum / (3.0 * static_cast<double>(nis_count)) : 0.0;
    out.samples = samples;
    out.rejected = rejected;
    out.dwells = dwells;
    out.rows = without_apart(rows);
    if (settings.method == Method::two_step) {
        std::map<int, KappaSpread> levels;
        for (const RunFilter& filter : filters) {
            if (filter.run != 0) levels[filter.run] = filter.kappa;
        }
        if (refused_run) levels[std::numeric_limits<int>::max()];
        if (std::string text = two_step_obstacle(levels); !text.empty())
            out.warnings.push_back(std::move(text));
    }
    if (std::string text = unobservable_warning(out.observable); !text.empty()) {
        out.warnings.push_back(std::move(text));
    }
    out.cross_check = cross_check(out.combinations);
    if (out.cross_check.done && !out.cross_check.agrees()) {
        out.warnings.push_back("a batch least squares over the same readings puts " +
                               out.cross_check.coefficient + " off by " +
                               std::to_string(out.cross_check.largest) + " sigma, expected " +
                               std::to_string(CrossCheck::kLimit) + " at most");
    }
    if (dwells_not_kept > 0) {
        out.warnings.push_back(std::to_string(dwells_not_kept) +
                               " dwells have no summary: no room was set aside");
    }
    return out;
}

Result Identification::result() const { return impl_->result(); }

const std::vector<DwellRow>& Identification::rows() const noexcept { return impl_->rows; }

const std::vector<DwellMeans>& Identification::means() const noexcept { return impl_->means; }

}  // namespace vibrig::estimator
