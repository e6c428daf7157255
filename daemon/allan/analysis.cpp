#include "daemon/allan/analysis.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "daemon/allan/column_file.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/text_line.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/median.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

constexpr double kTimeTolerance = 0.01;  // of tau0
constexpr std::size_t kFitGrid = 30;

/// Samples on a uniform grid by their time stamps; what is not there becomes NaN. Sets tau0 to the
/// median step if it is 0.
std::vector<double> on_grid(const ColumnFile& file, const std::string& name, double& tau0) {
    const std::vector<double>& t = file.times;
    std::vector<double> steps;
    for (std::size_t i = 1; i < t.size(); ++i) {
        if (!(t[i] > t[i - 1])) {
            throw std::runtime_error(
                name + printed(": time %g s follows %g s at sample %zu, expected growing times",
                               t[i], t[i - 1], i + 1));
        }
        steps.push_back(t[i] - t[i - 1]);
    }
    if (tau0 <= 0 && !steps.empty()) tau0 = estimator::median(steps);
    std::vector<double> values;
    double worst = 0;
    std::size_t where = 0;
    // Each step is compared by itself: a clock whose rate is slightly off does not add up.
    for (std::size_t i = 0; i < t.size(); ++i) {
        const double ratio = i > 0 ? (t[i] - t[i - 1]) / tau0 : 1;
        const double whole = std::max(1.0, std::round(ratio));
        if (std::abs(ratio - whole) > worst) {
            worst = std::abs(ratio - whole);
            where = i;
        }
        const double most = 10.0 * static_cast<double>(t.size()) + 1000;
        if (static_cast<double>(values.size()) + whole > most) {
            throw std::runtime_error(
                name + printed(": a step of %g s at sample %zu, most of the record would be "
                               "missing at tau0 = %g s",
                               ratio * tau0, i + 1, tau0));
        }
        values.insert(values.end(), static_cast<std::size_t>(whole) - 1, kNaN);
        values.push_back(file.values[i]);
    }
    if (worst > kTimeTolerance) {
        throw std::runtime_error(
            name + printed(": times are not uniform: the step to sample %zu (time %g s) is off by "
                           "%g %% of tau0 = %g s, at most %g %% allowed",
                           where + 1, t[where], 100 * worst, tau0, 100 * kTimeTolerance));
    }
    return values;
}

std::vector<std::size_t> factors_asked(const AllanRequest& request, std::size_t largest) {
    if (request.taus == "octave") {
        return allan::octave_factors(largest);
    }
    if (request.taus == "decade") {
        return allan::decade_factors(largest);
    }
    if (request.taus == "all") {
        return allan::all_factors(largest);
    }
    std::vector<double> taus;
    // With a comma at the end, so that an element that is missing there is one, too.
    std::istringstream list(request.taus + ',');
    for (std::string item; std::getline(list, item, ',');) {
        double tau = 0;
        if (!proto::read_number(item, tau) || !(tau > 0)) {
            throw std::runtime_error("--taus: \"" + item +
                                     "\" found, expected octave, decade, all or seconds such as "
                                     "1,10,100");
        }
        taus.push_back(tau);
    }
    return allan::factors_of(taus, request.tau0, largest);
}

/// In parts, so that a long list shows progress.
std::vector<allan::Point> curve(const allan::Series& series, const AllanRequest& request) {
    const std::vector<std::size_t> factors =
        factors_asked(request, allan::largest_factor(request.statistic, series.rates()));
    Progress progress("averaging");
    constexpr std::size_t kPart = 32;
    std::vector<allan::Point> points;
    for (std::size_t i = 0; i < factors.size(); i += kPart) {
        progress.show(i, factors.size());
        const std::size_t end = std::min(factors.size(), i + kPart);
        const auto part = allan::deviations(
            series, request.statistic, std::span(factors).subspan(i, end - i), request.confidence);
        points.insert(points.end(), part.begin(), part.end());
    }
    return points;
}

allan::Fit fit(const allan::Series& series, double to_deg_h) {
    const std::size_t n = series.rates();
    const auto points =
        allan::deviations(series, allan::Statistic::oadev, allan::log_factors(n / 2, kFitGrid));
    std::vector<allan::VariancePoint> variances;
    for (const allan::Point& p : points) {
        const double share = static_cast<double>(p.n) / static_cast<double>(n + 1 - 2 * p.m);
        variances.push_back({p.tau, p.m, std::pow(p.dev * to_deg_h, 2), share});
    }
    return allan::fit_noise(variances, n + 1, series.tau0);
}

void run_windows(const std::vector<double>& values, AllanAnalysis& analysis) {
    const AllanRequest& request = analysis.request;
    const allan::DynamicSettings settings = dynamic_settings(request);
    const std::size_t rates = request.phase ? values.size() - 1 : values.size();
    if (settings.window > rates) {
        throw std::runtime_error(
            printed("--dynamic: a window of %g s is %zu samples, the record has %zu",
                    request.window_s, settings.window, rates));
    }
    allan::DynamicAllan dynamic(settings);
    allan::StationarityMonitor monitor({request.alpha, 5}, dynamic);
    if (request.reference) {
        monitor.set_reference(*request.reference);
    }
    analysis.factors = dynamic.factors();
    Progress progress("windows");
    std::vector<allan::WindowRow> rows;
    for (std::size_t i = 0; i < rates; ++i) {
        const double rate = request.phase ? (values[i + 1] - values[i]) / request.tau0 : values[i];
        if (!dynamic.add(rate * analysis.to_deg_h)) {
            continue;
        }
        progress.show(i, rates);
        rows.push_back(dynamic.row());
        analysis.windows.push_back({rows.back(), monitor.check(rows.back())});
    }
    analysis.summary = allan::summarise(dynamic, rows);
    analysis.smallest_change = monitor.has_reference() ? monitor.smallest_change() : 0;
    if (!monitor.has_reference()) {
        analysis.warnings.push_back("no alarms: " + std::to_string(rows.size()) +
                                    " windows are too few to learn a reference; give --reference");
    }
}

void warn(const allan::Inspection& found, std::vector<double>& values, AllanAnalysis& analysis) {
    if (found.outliers > 0) {
        const bool drop = analysis.request.drop_outliers;
        analysis.warnings.push_back(
            printed("%zu outliers (more than 10 median absolute deviations), the first at sample "
                    "%zu%s",
                    found.outliers, found.first_outlier + 1,
                    drop ? ", treated as missing" : "; kept, see --drop-outliers"));
        if (drop) {
            // Again and again would eat the tails of the distribution: once is what was asked.
            for (const std::size_t i : allan::outliers(values)) {
                values[i] = kNaN;
            }
        }
    }
}

/// Steps and values with which nothing overflows on the way.
void check_range(const AllanRequest& request, const std::vector<double>& values) {
    if (!(request.tau0 > 0) || !std::isfinite(request.tau0)) {
        throw std::runtime_error(
            "--tau0: the step between samples in s is needed (or --time COLUMN)");
    }
    if (request.tau0 < kShortestStep || request.tau0 > kLongestStep) {
        throw std::runtime_error(
            request.file + printed(": steps of %g s found, expected 1e-9 to 1e9 s", request.tau0));
    }
    const auto large = std::find_if(values.begin(), values.end(),
                                    [](double v) { return std::abs(v) > kLargestValue; });
    if (large != values.end()) {
        throw std::runtime_error(request.file +
                                 printed(": sample %td: %g found, expected at most %g",
                                         large - values.begin() + 1, *large, kLargestValue));
    }
}

}  // namespace

double to_deg_per_hour(const std::string& unit, bool phase) {
    if (unit.empty() || unit == (phase ? "arcsec" : "deg/h")) {
        return 1;
    }
    if (unit == (phase ? "deg" : "deg/s")) {
        return 3600;
    }
    if (unit == (phase ? "rad" : "rad/s")) {
        return 1 / estimator::kRadPerArcsec;
    }
    throw std::runtime_error("--unit: \"" + unit + "\" found, expected " +
                             (phase ? "arcsec, deg or rad" : "deg/h, deg/s or rad/s"));
}

allan::DynamicSettings dynamic_settings(const AllanRequest& request) {
    allan::DynamicSettings settings;
    settings.tau0 = request.tau0;
    settings.window = static_cast<std::size_t>(std::llround(request.window_s / request.tau0));
    settings.overlap = request.overlap;
    settings.shape = request.shape;
    settings.mode = request.mode;
    settings.known_mean = request.known_mean;
    return settings;
}

AllanAnalysis analyse(const AllanRequest& asked) {
    AllanAnalysis analysis;
    analysis.request = asked;
    AllanRequest& request = analysis.request;
    analysis.to_deg_h = to_deg_per_hour(request.unit, request.phase);
    ColumnFile file;
    {
        Progress progress("reading " + request.file);
        file = read_columns(
            request.file, {request.column, request.time},
            [&](std::size_t done, std::size_t all) { progress.show(done, std::max(all, done)); });
    }
    analysis.column = file.column;
    if (!file.warning.empty()) analysis.warnings.push_back(file.warning);
    std::vector<double> values =
        request.time.empty() ? std::move(file.values) : on_grid(file, request.file, request.tau0);
    check_range(request, values);
    // A phase wanders far without an outlier: its steps are what can be judged.
    std::vector<double> steps;
    if (request.phase) {
        for (std::size_t i = 1; i < values.size(); ++i) {
            steps.push_back(values[i] - values[i - 1]);
        }
    }
    const allan::Inspection found = allan::inspect(request.phase ? steps : values);
    if (request.phase && request.drop_outliers) {
        throw std::runtime_error("--drop-outliers: for rates only");
    }
    warn(found, values, analysis);
    const allan::Series series = request.phase ? allan::Series::from_phase(values, request.tau0)
                                               : allan::Series::from_rate(values, request.tau0);
    try {
        allan::require_usable(series, found, values.empty() ? kNaN : values.front());
    } catch (const allan::DataError& error) {
        throw std::runtime_error(request.file + ": " + error.what());
    }
    analysis.samples = series.samples;
    analysis.missing = series.missing;
    analysis.longest_gap = series.longest_gap;
    if (series.missing > 0) {
        const auto first =
            std::ranges::find_if_not(values, [](double v) { return std::isfinite(v); });
        analysis.warnings.push_back(
            printed("%zu samples are missing (the first is sample %td, longest gap %zu): no "
                    "difference spans a gap, degrees of freedom are lowered accordingly",
                    series.missing, first - values.begin() + 1, series.longest_gap));
    }
    analysis.points = curve(series, request);
    if (request.fit) {
        analysis.fit = fit(series, analysis.to_deg_h);
        if (!analysis.fit->ramp_note.empty()) {
            analysis.warnings.push_back(analysis.fit->ramp_note);
        }
    }
    if (request.window_s > 0) {
        run_windows(values, analysis);
    }
    return analysis;
}

}  // namespace vibrig::tool
