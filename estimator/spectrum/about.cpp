#include "estimator/spectrum/about.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "estimator/spectrum/elastic.hpp"
#include "estimator/spectrum/sampling.hpp"

namespace vibrig::estimator::spectrum {

namespace {

constexpr double kWithin = 1.5;    ///< it is looked for within this factor of the resonance
constexpr double kOff = 1.01;      ///< and not nearer than that: the pair is 2 % apart
constexpr double kApart = 1.02;    ///< closer ones are one frequency of a survey
constexpr double kServes = 0.707;  ///< of the best response: half of its information
constexpr double kNamed = 4;       ///< log odds

/// Of a gyro's mixture, which may hold several resonances, those of one place.
struct Line {
    std::vector<std::pair<double, Resonance>> weighted;
    double hz = 0;

    [[nodiscard]] double response(double at_hz) const {
        double sum = 0;
        for (const auto& [weight, of] : weighted) sum += weight * in_phase(at_hz, of);
        return sum;
    }
};

std::vector<Line> lines_of(const std::vector<Hypothesis>& mixture) {
    double resonant = 0, all = 0;
    std::size_t most = 0;
    for (const Hypothesis& one : mixture) {
        all += one.weight;
        if (one.resonances.empty()) continue;
        resonant += one.weight;
        most = std::max(most, one.resonances.size());
    }
    std::vector<Line> lines;
    if (!(resonant > (all - resonant) * std::exp(kNamed))) return lines;
    for (std::size_t m = 0; m < most; ++m) {
        Line line;
        double sum = 0, log_hz = 0;
        for (const Hypothesis& one : mixture) {
            if (one.resonances.size() <= m) continue;
            line.weighted.emplace_back(one.weight, one.resonances[m]);
            sum += one.weight;
            log_hz += one.weight * std::log(one.resonances[m].hz);
        }
        line.hz = std::exp(log_hz / sum);
        for (auto& [weight, of] : line.weighted) weight /= sum;
        lines.push_back(std::move(line));
    }
    return lines;
}

/// On one side of a line, `sign` 1 below it and -1 above it. None: nothing free there.
std::optional<double> best_beside(const Line& line, double sign, const Sampling& sampling,
                                  const std::vector<double>& planned) {
    const double near = sign > 0 ? line.hz / kOff : line.hz * kOff;
    const double far = sign > 0 ? line.hz / kWithin : line.hz * kWithin;
    const double low = std::min(near, far), high = std::max(near, far);
    double most = 0, most_free = 0;
    std::optional<double> best, serves;
    constexpr int kSteps = 10;  // in a hertz; so that they are whole ones
    for (int k = static_cast<int>(std::ceil(low * kSteps)); k <= high * kSteps; ++k) {
        const double hz = static_cast<double>(k) / kSteps;
        const double shown = sign * line.response(hz);
        if (forbidden(hz, sampling.sample_hz, sampling.window_s, kHarmonicsPlanned)) continue;
        most = std::max(most, shown);
        const bool apart = std::ranges::all_of(planned, [hz](double other) {
            return std::max(hz, other) >= kApart * std::min(hz, other);
        });
        if (!apart || shown <= most_free) continue;
        most_free = shown;
        best = hz;
    }
    double most_planned = 0;
    for (const double hz : planned) {
        if (hz < low || hz > high || sign * line.response(hz) <= most_planned) continue;
        most_planned = sign * line.response(hz);
        serves = hz;
    }
    return serves && most_planned >= kServes * most ? serves : best;
}

}  // namespace

std::vector<About> about_resonances(const std::array<std::vector<Hypothesis>, 3>& mixtures,
                                    const Sampling& sampling, std::vector<double> beside) {
    std::vector<About> out;
    for (std::size_t j = 0; j < mixtures.size(); ++j) {
        for (const Line& line : lines_of(mixtures[j])) {
            About about{j, line.hz, 0, 0};
            for (double* hz : {&about.below_hz, &about.above_hz}) {
                const bool below = hz == &about.below_hz;
                const auto found = best_beside(line, below ? 1 : -1, sampling, beside);
                if (!found)
                    throw plan::PlanError("--about: found no free frequency " +
                                          std::string(below ? "below" : "above") +
                                          " the resonance of gyro " + "xyz"[j] + " at " +
                                          std::to_string(line.hz) +
                                          " Hz, expected one within a factor of 1.5");
                *hz = *found;
                if (std::ranges::find(beside, *found) == beside.end()) beside.push_back(*found);
            }
            out.push_back(about);
        }
    }
    if (out.empty())
        throw plan::PlanError(
            "--about: found no gyro whose elastic part is named (log odds above 4), expected a "
            "result with a resonance");
    return out;
}

std::vector<double> frequencies_of(const std::vector<About>& about) {
    std::vector<double> hz;
    for (const About& one : about) hz.insert(hz.end(), {one.below_hz, one.above_hz});
    std::ranges::sort(hz);
    hz.erase(std::unique(hz.begin(), hz.end()), hz.end());
    return hz;
}

}  // namespace vibrig::estimator::spectrum
