#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "daemon/tool/analysis/allan_analysis.hpp"

namespace vibrig::tool {

namespace {

constexpr std::size_t kModelPoints = 121;

std::string upper(std::string text) {
    for (char& c : text) {
        c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    }
    return text;
}

std::string unit_of(const AllanAnalysis& analysis) {
    const AllanRequest& request = analysis.request;
    const std::string unit = !request.unit.empty() ? request.unit
                             : request.phase       ? "arcsec"
                                                   : "deg/h";
    const bool time = request.statistic == allan::Statistic::tdev;
    if (time) {
        return request.phase ? unit : unit + " s";
    }
    return request.phase ? unit + "/s" : unit;
}

std::string value_text(const char* name, const allan::FittedTerm& term, const char* unit) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%s = %.3g %s", name, term.value, unit);
    return text.data();
}

/// The model and the asymptote of each detected term, with the slope people look for.
void add_fit(const AllanAnalysis& analysis, plot::Chart& chart) {
    const double first = analysis.points.front().tau;
    const double last = analysis.points.back().tau;
    const allan::Terms terms = analysis.fit->values();
    plot::Curve model{"fit", {}, {}, {}, {}, plot::Look::line};
    for (std::size_t i = 0; i < kModelPoints; ++i) {
        const double part = static_cast<double>(i) / static_cast<double>(kModelPoints - 1);
        const double tau = first * std::pow(last / first, part);
        model.x.push_back(tau);
        model.y.push_back(std::sqrt(allan::model_variance(terms, tau)) / analysis.to_deg_h);
    }
    chart.curves.push_back(model);
    if (analysis.fit->slow.found && !analysis.fit->slow.determined) {
        plot::Curve slow{"slow noise", {}, {}, {}, {}, plot::Look::dashed};
        allan::Terms rest = terms;
        rest[static_cast<std::size_t>(allan::Term::Q)] = 0;
        rest[static_cast<std::size_t>(allan::Term::N)] = 0;
        for (std::size_t i = 0; i < model.x.size(); ++i) {
            const double y = std::sqrt(allan::model_variance(rest, model.x[i])) / analysis.to_deg_h;
            slow.x.push_back(model.x[i]);
            slow.y.push_back(y > 0.05 * model.y[i] ? y : kNaN);
        }
        chart.curves.push_back(slow);
    }
    if (const auto verdict = analysis.fit->verdict(); !verdict.empty())
        chart.notes.push_back(verdict);
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        if (!analysis.fit->terms[j].detected) {
            continue;
        }
        plot::Curve term{
            value_text(allan::kTermNames[j], analysis.fit->terms[j], allan::kTermUnits[j]),
            {},
            {},
            {},
            {},
            plot::Look::dashed};
        for (std::size_t i = 0; i < model.x.size(); ++i) {
            const double y =
                terms[j] *
                std::sqrt(allan::term_variance(static_cast<allan::Term>(j), model.x[i])) /
                analysis.to_deg_h;
            // Far below the curve a term says nothing and would stretch the axis.
            const bool near = y > 0.05 * model.y[i];
            term.x.push_back(model.x[i]);
            term.y.push_back(near ? y : kNaN);
        }
        chart.curves.push_back(term);
    }
}

}  // namespace

plot::Chart deviation_chart(const AllanAnalysis& analysis) {
    const std::string name = upper(allan::name_of(analysis.request.statistic));
    plot::Chart chart;
    chart.title = name + " of " + std::filesystem::path(analysis.request.file).filename().string() +
                  (analysis.column.empty() || analysis.column == "1" ? "" : ", " + analysis.column);
    chart.x = plot::Axis("averaging time tau [s]", true);
    chart.y = plot::Axis(name + " [" + unit_of(analysis) + "]", true);
    plot::Curve measured{name, {}, {}, {}, {}, plot::Look::dots};
    for (const allan::Point& p : analysis.points) {
        measured.x.push_back(p.tau);
        measured.y.push_back(p.dev);
        measured.low.push_back(p.lo);
        measured.high.push_back(p.hi);
    }
    constexpr std::size_t kMostDots = 100;
    if (measured.x.size() > kMostDots) {
        measured.look = plot::Look::line;
    }
    chart.curves.push_back(measured);
    const allan::Statistic s = analysis.request.statistic;
    if (analysis.fit && (s == allan::Statistic::adev || s == allan::Statistic::oadev ||
                         s == allan::Statistic::totdev)) {
        add_fit(analysis, chart);
    }
    return chart;
}

namespace {

/// Borders halfway between neighbours, in the logarithm for tau.
std::vector<double> borders(const std::vector<double>& centres, bool log) {
    std::vector<double> at;
    const auto fold = [&](double v) { return log ? std::log(v) : v; };
    const auto unfold = [&](double v) { return log ? std::exp(v) : v; };
    const std::size_t n = centres.size();
    const double first = n > 1 ? fold(centres[1]) - fold(centres[0]) : 1;
    const double last = n > 1 ? fold(centres[n - 1]) - fold(centres[n - 2]) : 1;
    at.push_back(unfold(fold(centres[0]) - first / 2));
    for (std::size_t i = 0; i + 1 < n; ++i) {
        at.push_back(unfold((fold(centres[i]) + fold(centres[i + 1])) / 2));
    }
    at.push_back(unfold(fold(centres[n - 1]) + last / 2));
    return at;
}

}  // namespace

plot::Chart surface_chart(const AllanAnalysis& analysis) {
    plot::Chart chart;
    chart.title = "Dynamic Allan deviation of " +
                  std::filesystem::path(analysis.request.file).filename().string();
    chart.x = plot::Axis("time [s]", false);
    chart.y = plot::Axis("averaging time tau [s]", true);
    plot::HeatMap map;
    map.label = "OADEV [deg/h]";
    map.log = true;
    std::vector<double> times;
    for (const auto& [row, alarms] : analysis.windows) {
        times.push_back(row.centre_s);
        std::vector<double> column;
        for (const double variance : row.allan) {
            column.push_back(row.refused || variance <= 0 ? kNaN : std::sqrt(variance));
        }
        map.value.push_back(column);
    }
    std::vector<double> taus;
    for (const std::size_t m : analysis.factors) {
        taus.push_back(static_cast<double>(m) * analysis.request.tau0);
    }
    map.x = borders(times, false);
    map.y = borders(taus, true);
    chart.maps.push_back(map);
    plot::Curve alarmed{"", {}, {}, {}, {}, plot::Look::dots};
    for (const auto& [row, alarms] : analysis.windows) {
        for (const allan::Alarm& alarm : alarms) {
            if (alarm.reading != allan::Reading::mean_step) {
                alarmed.x.push_back(row.centre_s);
                alarmed.y.push_back(alarm.tau);
            }
        }
    }
    if (!alarmed.x.empty()) {
        chart.curves = {{}, alarmed};
        chart.notes.emplace_back("Dots: ratio to the reference outside its interval.");
    }
    return chart;
}

plot::Chart traces_chart(const AllanAnalysis& analysis) {
    plot::Chart chart;
    chart.title = "Coefficients over time";
    chart.x = plot::Axis("time [s]", false);
    chart.y = plot::Axis("coefficient [its own unit]", true);
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        plot::Curve trace{std::string(allan::kTermNames[j]) + " [" + allan::kTermUnits[j] + "]",
                          {},
                          {},
                          {},
                          {},
                          plot::Look::dots};
        for (const auto& [row, alarms] : analysis.windows) {
            const allan::FittedTerm& term = row.fit.terms[j];
            const bool there = !row.refused && term.detected;
            trace.x.push_back(row.centre_s);
            trace.y.push_back(there ? term.value : kNaN);
            const bool bounded = there && term.sigma < term.value;
            trace.low.push_back(bounded ? term.value - term.sigma : kNaN);
            trace.high.push_back(bounded ? term.value + term.sigma : kNaN);
        }
        chart.curves.push_back(trace);
    }
    chart.notes.emplace_back("No dot: not detected in that window. Bars: 1 sigma.");
    return chart;
}

void allan_plot(const AllanAnalysis& analysis, const std::string& path) {
    const std::filesystem::path where(path);
    const bool dynamic = !analysis.windows.empty();
    if (where.extension() == ".svg") {
        plot::write_file(path,
                         (dynamic ? surface_chart(analysis) : deviation_chart(analysis)).svg());
        return;
    }
    plot::make_folder(path);
    plot::write_file((where / "deviation.svg").string(), deviation_chart(analysis).svg());
    if (dynamic) {
        plot::write_file((where / "surface.svg").string(), surface_chart(analysis).svg());
        plot::write_file((where / "coefficients.svg").string(), traces_chart(analysis).svg());
    }
}

}  // namespace vibrig::tool
