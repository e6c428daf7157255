#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/plot/chart.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/study/reduce.hpp"
#include "daemon/study/statistics.hpp"
#include "daemon/tool/design/study_output.hpp"
#include "estimator/filter/parameters.hpp"
#include "proto/durable_file.hpp"

namespace vibrig::tool::studies {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::size_t kMostCharts = 100;    // points of a grid
constexpr std::size_t kMostCompared = 100;  // recordings in a chart
constexpr std::array<std::pair<const char*, const char*>, 3> kUnits{
    {{"bias", "deg/h"}, {"unbalance", "deg/h/g"}, {"compliance", "deg/h/g^2"}}};

constexpr std::array<std::pair<const char*, const char*>, 2> kClaims{
    {{"all", "all inputs"}, {"noise", "noise alone"}}};
constexpr double kShift = 0.15;  // of two points at one place, to either side

constexpr const char* kNothing = "nothing to draw, no chart was written";

std::string first_of(std::size_t shown, std::size_t all, const std::string& what) {
    return "the first " + std::to_string(shown) + " of " + std::to_string(all) + " " + what;
}

/// Places 1, 2 ... of what is counted, with room for points beside them.
plot::Axis axis_of_places(const std::string& label, double first, double last) {
    plot::Axis axis(label);
    axis.low = first - 0.6;
    axis.high = last + 0.6;
    axis.exact = true;
    return axis;
}

/// The 30, by name.
plot::Axis axis_of_coefficients() {
    plot::Axis axis = axis_of_places("coefficient", 1, estimator::kParameters);
    for (const char* name : estimator::parameter_names())
        axis.named.emplace_back(static_cast<double>(axis.named.size() + 1), name);
    return axis;
}

plot::Axis axis_of_points(const Json& result) {
    return axis_of_places("point of the grid", 0,
                          result.at("points").back().at("point").get<double>());
}

void add_interval(plot::Curve& curve, double x, const Json& interval) {
    curve.add(x, number_at(interval, "/value"), number_at(interval, "/low"),
              number_at(interval, "/high"));
}

/// Of one point: every coefficient's interval below `pointer`.
plot::Chart coefficient_chart(const Json& point, const std::string& title, const char* y,
                              const std::vector<std::pair<const char*, const char*>>& curves) {
    plot::Chart chart{title, axis_of_coefficients(), plot::Axis(y)};
    double shift = -kShift;
    for (const auto& [name, pointer] : curves) {
        plot::Curve curve{.name = name, .look = plot::Look::dots};
        double at = 1;
        for (const Json& c : point.at("coefficients")) {
            const Json::json_pointer where(pointer);
            if (c.contains(where)) add_interval(curve, at + shift, c.at(where));
            at += 1;
        }
        shift += 2 * kShift;
        chart.curves.push_back(std::move(curve));
    }
    chart.notes = {grid_text(point) + "; bars: 95 %"};
    return chart;
}

plot::Chart nees_chart(const Json& point) {
    plot::Chart chart{"NEES in 20 bins that are equally likely under chi-square 30",
                      axis_of_places("bin", 1, study::kNeesBins), plot::Axis("campaigns")};
    chart.y.include(0);
    double total = 0, shift = -kShift;
    for (const auto& [claim, name] : kClaims) {
        const Json& nees = point.at("nees").at(claim);
        if (!nees.contains("histogram")) continue;
        plot::Curve curve{.name = name, .look = plot::Look::dots};
        double at = 1;
        for (const Json& count : nees.at("histogram")) {
            curve.add(at++ + shift, count.get<double>());
        }
        shift += 2 * kShift;
        total = nees.at("n").get<double>();
        chart.notes.push_back(printed("%s: NEES %.2f of %.0f, %.2f to %.2f expected (95 %%)", name,
                                      number_at(nees, "/mean"), number_at(nees, "/expected"),
                                      number_at(nees, "/low"), number_at(nees, "/high")));
        chart.curves.push_back(std::move(curve));
    }
    if (chart.curves.empty())
        chart.notes.emplace_back("no campaign determines all 30 coefficients: there is no NEES");
    const double share = 1.0 / study::kNeesBins, expected = share * total;
    const double half = 2 * std::sqrt(expected * (1 - share));
    plot::Curve theory = plot::level_line("theory", chart.x.low, chart.x.high, expected);
    theory.low.assign(2, std::max(0.0, expected - half));
    theory.high.assign(2, expected + half);
    chart.curves.push_back(std::move(theory));
    chart.notes.insert(chart.notes.begin(),
                       grid_text(point) + "; band: two standard deviations of a bin's count");
    return chart;
}

/// Root of NEES / 30 over the grid: rms z with an interval that correlations do not touch.
plot::Chart grid_chart(const Json& result) {
    plot::Chart chart{"rms z over the grid, of 30 coefficients together", axis_of_points(result),
                      plot::Axis("sqrt(NEES / 30)")};
    double shift = -kShift;
    for (const auto& [claim, name] : kClaims) {
        plot::Curve curve{.name = name, .look = plot::Look::dots};
        for (const Json& point : result.at("points")) {
            const Json& nees = point.at("nees").at(claim);
            if (nees.at("n") == 0) continue;
            const double mean = number_at(nees, "/mean"), expected = number_at(nees, "/expected");
            curve.add(point.at("point").get<double>() + shift, std::sqrt(mean / expected),
                      std::sqrt(mean / number_at(nees, "/high")),
                      std::sqrt(mean / number_at(nees, "/low")));
        }
        shift += 2 * kShift;
        chart.curves.push_back(std::move(curve));
    }
    chart.curves.push_back(plot::level_line("theory", chart.x.low, chart.x.high, 1));
    chart.notes = {"bars: 95 %"};
    return chart;
}

/// Root mean square of the errors of all coefficients of a unit, over the grid.
plot::Chart error_chart(const Json& result, const std::string& unit) {
    plot::Chart chart{"rms error over the grid", axis_of_points(result),
                      plot::Axis("rms error, " + unit)};
    plot::Curve errors{.name = "error", .look = plot::Look::dots};
    plot::Curve claimed{.name = "claimed u, all inputs", .look = plot::Look::dashed};
    for (const Json& point : result.at("points")) {
        double squares = 0, claims = 0, count = 0, runs = 0;
        for (const Json& c : point.at("coefficients")) {
            if (c.at("unit") != unit || !c.contains("all")) continue;
            squares += std::pow(number_at(c, "/rms_error"), 2);
            claims += std::pow(number_at(c, "/all/sigma"), 2);
            runs = std::max(runs, c.at("n").get<double>());
            ++count;
        }
        if (count == 0) continue;
        // As if the coefficients of a campaign were one: the interval is never too short.
        const auto rms =
            study::rms_interval(runs * squares / count, static_cast<std::uint64_t>(runs));
        errors.add(point.at("point").get<double>(), rms.value, rms.low, rms.high);
        claimed.add(errors.x.back(), std::sqrt(claims / count));
    }
    chart.curves = {std::move(errors), std::move(claimed)};
    chart.notes = {"bars: 95 %"};
    return chart;
}

/// Before each title: a study's own campaigns are on no rig at all, recordings may be.
std::string title_mark(const Json& result) {
    const bool drawn = result.at("kind") == "uncertainty";
    if (!result.contains("recordings"))
        return !drawn || result.value("simulated", false) ? "SIMULATED: " : "";
    const Json& all = result.at("recordings");
    const auto simulated =
        std::ranges::count_if(all, [](const Json& one) { return one.value("simulated", false); });
    if (simulated == 0) return "";
    if (static_cast<std::size_t>(simulated) == all.size()) return "SIMULATED: ";
    return printed("SIMULATED, %ld of %zu recordings: ", static_cast<long>(simulated), all.size());
}

void write_chart(const Json& result, const std::string& path, plot::Chart chart) {
    chart.title = title_mark(result) + chart.title;
    proto::write_output(path, chart.svg());
}

bool determined(const Json& point) {
    const Json& coefficients = point.at("coefficients");
    return std::ranges::any_of(coefficients, [](const Json& c) { return c.contains("all"); });
}

std::string write_campaign_charts(const Json& result, const std::string& folder) {
    const Json& points = result.at("points");
    if (std::ranges::none_of(points, determined)) return kNothing;
    plot::make_folder(folder);
    write_chart(result, folder + "/rms-z-grid.svg", grid_chart(result));
    for (const auto& [name, unit] : kUnits)
        write_chart(result, folder + "/rms-error-grid-" + name + ".svg", error_chart(result, unit));
    for (std::size_t i = 0; i < std::min(points.size(), kMostCharts); ++i) {
        const Json& point = points[i];
        const std::string name =
            points.size() == 1 ? "" : "-" + std::to_string(point.at("point").get<long>());
        plot::Chart z =
            coefficient_chart(point, "rms of error over claimed u", "rms z",
                              {{"all inputs", "/all/rms_z"}, {"noise alone", "/noise/rms_z"}});
        z.curves.push_back(plot::level_line("theory", 1, 30, 1));
        write_chart(result, folder + "/rms-z" + name + ".svg", std::move(z));
        plot::Chart within = coefficient_chart(
            point, "share of errors within 1.96 u", "coverage",
            {{"all inputs", "/all/coverage/95"}, {"noise alone", "/noise/coverage/95"}});
        within.curves.push_back(plot::level_line("theory", 1, 30, 0.95));
        write_chart(result, folder + "/coverage" + name + ".svg", std::move(within));
        write_chart(result, folder + "/nees" + name + ".svg", nees_chart(point));
    }
    return points.size() > kMostCharts
               ? first_of(kMostCharts, points.size(), "points") +
                     " have charts of their own, all are in those over the grid"
               : "";
}

/// E_n = 2 z, z being the difference over both standard uncertainties.
double z_of(const Json& recording, std::size_t i) {
    return 2 * number_at(recording, ("/e_n/" + std::to_string(i)).c_str());
}

/// Of every coefficient over the recordings: rms z, and the share with E_n within 1.
std::string write_recordings_charts(const Json& result, const std::string& folder) {
    plot::Curve rms = plot::Curve{.name = "new against old", .look = plot::Look::dots},
                within = rms;
    plot::Chart z, coverage, each;
    std::vector<const Json*> compared;
    for (const Json& one : result.at("recordings")) {
        if (one.contains("largest_e_n") && one.at("largest_e_n").is_number())
            compared.push_back(&one);
    }
    if (compared.empty()) return kNothing;
    plot::make_folder(folder);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const double at = static_cast<double>(i + 1);
        double squares = 0;
        std::uint64_t count = 0, good = 0;
        for (const Json* one : compared) {
            const double value = z_of(*one, i);
            if (!std::isfinite(value)) continue;
            squares += value * value;
            ++count;
            if (std::abs(value) <= 2) ++good;
        }
        if (count == 0) continue;
        for (const auto& [curve, of] : {std::pair{&rms, study::rms_interval(squares, count)},
                                        {&within, study::share_interval(good, count)}})
            curve->add(at, of.value, of.low, of.high);
    }
    const std::string note = std::to_string(compared.size()) + " recordings; bars: 95 %";
    z.title = "new less old result over both standard uncertainties";
    z.x = coverage.x = axis_of_coefficients();
    z.y = plot::Axis("rms z");
    z.curves = {std::move(rms), plot::level_line("independent results", 1, 30, 1)};
    z.notes = {note, "both rest on the same data: less than 1 is to be expected"};
    coverage.title = "share of recordings with E_n within 1";
    coverage.y = plot::Axis("share");
    coverage.curves = {std::move(within)};
    coverage.notes = {note};
    write_chart(result, folder + "/rms-z.svg", std::move(z));
    write_chart(result, folder + "/coverage.svg", std::move(coverage));

    plot::Curve largest{.name = "largest of 30", .look = plot::Look::dots};
    for (std::size_t k = 0; k < std::min(compared.size(), kMostCompared); ++k) {
        largest.add(static_cast<double>(k + 1), compared[k]->at("largest_e_n").get<double>());
    }
    const double last = std::max(2.0, largest.x.back());
    each.title = "E_n of each recording, those that differ most first";
    each.x = plot::Axis("recording");
    each.y = plot::Axis("largest E_n");
    each.curves = {std::move(largest), plot::level_line("expanded uncertainties", 1, last, 1)};
    std::string remark;
    if (compared.size() > kMostCompared) {
        remark = first_of(kMostCompared, compared.size(), "recordings, those that differ most,") +
                 " are in the chart of E_n";
        each.notes = {remark};
    }
    write_chart(result, folder + "/e-n.svg", std::move(each));
    return remark;
}

/// u and the ends of the intervals as drawn, against the budget's.
std::string write_propagation_charts(const Json& result, const std::string& folder) {
    plot::Chart u, ends;
    plot::Curve ratio{.name = "drawn", .look = plot::Look::dots};
    std::array<plot::Curve, 2> off{plot::Curve{.name = "lower end", .look = plot::Look::dots},
                                   plot::Curve{.name = "upper end", .look = plot::Look::dots}};
    double at = 0;
    for (const Json& c : result.at("coefficients")) {
        at += 1;
        if (!c.contains("value")) continue;
        const auto add = [](plot::Curve& curve, double x, double y, double half) {
            curve.add(x, y, y - half, y + half);
        };
        const double budget = number_at(c, "/gum/u"), tolerance = number_at(c, "/tolerance");
        add(ratio, at, number_at(c, "/u") / budget, 2 * number_at(c, "/standard_error/u") / budget);
        add(off[0], at - kShift,
            (number_at(c, "/symmetric/0") - number_at(c, "/gum/low")) / tolerance,
            2 * number_at(c, "/standard_error/low") / tolerance);
        add(off[1], at + kShift,
            (number_at(c, "/symmetric/1") - number_at(c, "/gum/high")) / tolerance,
            2 * number_at(c, "/standard_error/high") / tolerance);
    }
    if (ratio.x.empty()) return kNothing;
    plot::make_folder(folder);
    const std::string note = std::to_string(result.at("trials").get<long>()) +
                             " trials; bars: two standard errors; the budget is " +
                             result.at("verdict").get<std::string>();
    u.title = "rms z of the draws: u drawn over u of the budget";
    u.x = ends.x = axis_of_coefficients();
    u.y = plot::Axis("rms z");
    u.curves = {std::move(ratio), plot::level_line("budget", 1, 30, 1)};
    ends.title = "ends of the 95 % intervals, drawn less budget";
    ends.y = plot::Axis("of the numerical tolerance");
    ends.curves = {std::move(off[0]), std::move(off[1]), plot::level_line("tolerance", 1, 30, 1),
                   plot::level_line("", 1, 30, -1)};
    u.notes = ends.notes = {note};
    write_chart(result, folder + "/rms-z.svg", std::move(u));
    write_chart(result, folder + "/interval-ends.svg", std::move(ends));
    return "";
}

}  // namespace

std::string write_charts(const Json& result, const std::string& folder) {
    if (result.contains("recordings")) return write_recordings_charts(result, folder);
    if (result.at("kind") == "uncertainty") return write_propagation_charts(result, folder);
    return write_campaign_charts(result, folder);
}

}  // namespace vibrig::tool::studies
