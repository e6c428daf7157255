#include <cmath>
#include <filesystem>

#include "daemon/allan/analysis.hpp"
#include "daemon/results/text_line.hpp"

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

/// The model and the asymptote of each detected term, with the slope people look for.
void add_fit(const AllanAnalysis& analysis, plot::Chart& chart) {
    const double first = analysis.points.front().tau;
    const double last = analysis.points.back().tau;
    const allan::Terms terms = analysis.fit->values();
    plot::Curve model{"fit"};
    for (std::size_t i = 0; i < kModelPoints; ++i) {
        const double part = static_cast<double>(i) / static_cast<double>(kModelPoints - 1);
        const double tau = first * std::pow(last / first, part);
        model.add(tau, std::sqrt(allan::model_variance(terms, tau)) / analysis.to_deg_h);
    }
    chart.curves.push_back(model);
    if (analysis.fit->slow.found && !analysis.fit->slow.determined) {
        plot::Curve slow{.name = "slow noise", .look = plot::Look::dashed};
        allan::Terms rest = terms;
        rest[static_cast<std::size_t>(allan::Term::Q)] = 0;
        rest[static_cast<std::size_t>(allan::Term::N)] = 0;
        for (std::size_t i = 0; i < model.x.size(); ++i) {
            const double y = std::sqrt(allan::model_variance(rest, model.x[i])) / analysis.to_deg_h;
            slow.add(model.x[i], y > 0.05 * model.y[i] ? y : kNaN);
        }
        chart.curves.push_back(slow);
    }
    if (const auto verdict = analysis.fit->verdict(); !verdict.empty())
        chart.notes.push_back(verdict);
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        if (!analysis.fit->terms[j].detected) {
            continue;
        }
        plot::Curve term{.name = printed("%s = %.3g %s", allan::kTermNames[j],
                                         analysis.fit->terms[j].value, allan::kTermUnits[j]),
                         .look = plot::Look::dashed};
        for (std::size_t i = 0; i < model.x.size(); ++i) {
            const double y =
                terms[j] *
                std::sqrt(allan::term_variance(static_cast<allan::Term>(j), model.x[i])) /
                analysis.to_deg_h;
            // Far below the curve a term says nothing and would stretch the axis.
            const bool near = y > 0.05 * model.y[i];
            term.add(model.x[i], near ? y : kNaN);
        }
        chart.curves.push_back(term);
    }
}

}  // namespace

plot::Chart deviation_chart(const AllanAnalysis& analysis) {
    const std::string name = upper(allan::name_of(analysis.request.statistic));
    plot::Chart chart{
        name + " of " + std::filesystem::path(analysis.request.file).filename().string() +
            (analysis.column.empty() || analysis.column == "1" ? "" : ", " + analysis.column),
        plot::Axis("averaging time tau [s]", true),
        plot::Axis(name + " [" + unit_of(analysis) + "]", true)};
    plot::Curve measured{.name = name, .look = plot::Look::dots};
    for (const allan::Point& p : analysis.points) {
        measured.add(p.tau, p.dev, p.lo, p.hi);
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
    plot::Chart chart{"Dynamic Allan deviation of " +
                          std::filesystem::path(analysis.request.file).filename().string(),
                      plot::Axis("time [s]", false), plot::Axis("averaging time tau [s]", true)};
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
    plot::Curve alarmed{.look = plot::Look::dots};
    for (const auto& [row, alarms] : analysis.windows) {
        for (const allan::Alarm& alarm : alarms) {
            if (alarm.reading != allan::Reading::mean_step) {
                alarmed.add(row.centre_s, alarm.tau);
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
    plot::Chart chart{"Coefficients over time", plot::Axis("time [s]", false),
                      plot::Axis("coefficient [its own unit]", true)};
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        plot::Curve trace{
            .name = std::string(allan::kTermNames[j]) + " [" + allan::kTermUnits[j] + "]",
            .look = plot::Look::dots};
        for (const auto& [row, alarms] : analysis.windows) {
            const allan::FittedTerm& term = row.fit.terms[j];
            const bool there = !row.refused && term.detected;
            trace.add(row.centre_s, there ? term.value : kNaN);
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
    plot::Pictures pictures{{"deviation", deviation_chart(analysis).svg()}};
    if (!analysis.windows.empty())
        pictures = {{"surface", surface_chart(analysis).svg()},
                    pictures.front(),
                    {"coefficients", traces_chart(analysis).svg()}};
    plot::write_pictures(path, pictures);
}

}  // namespace vibrig::tool
