#include "daemon/tool/recordings/trend_output.hpp"

#include <nlohmann/json.hpp>

#include "daemon/plot/chart.hpp"
#include "daemon/results/json_values.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "daemon/tool/simulated.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kSurely = 0.01;  // p of an instability that is starred
constexpr double kDay_ns = 86'400e9;

Json instability_json(const archive::Instability& of) {
    if (!of.tested) return nullptr;
    return {{"value", of.value},
            {"f", number_or_null(of.f)},
            {"dof", of.dof},
            {"dof_of_error", number_or_null(of.dof_of_error)},
            {"p", number_or_null(of.p)}};
}

std::string instability_text(const archive::Instability& of) {
    if (!of.tested) return "          -";
    return printed("%9.4f %c", of.value, of.p < kSurely ? '*' : ' ');
}

double days_of(const archive::Trend& trend, const archive::TrendPoint& point) {
    return static_cast<double>(trend.campaigns[point.campaign].started_utc_ns -
                               trend.campaigns.front().started_utc_ns) /
           kDay_ns;
}

/// Null: a linear one's, or of no single frequency, or not noted; `vibration` says which.
Json at_hz_json(const std::optional<double>& at_hz) {
    return at_hz && *at_hz >= 0 ? Json(*at_hz) : Json(nullptr);
}

/// In a chart's title.
std::string mark_of(const archive::Trend& trend) { return trend.simulated ? "SIMULATED: " : ""; }

std::string time_axis(const archive::Trend& trend) {
    return "days since " + iso_text(trend.campaigns.front().started_utc_ns);
}

}  // namespace

Json trend_json(const std::string& serial, const archive::Trend& trend, double shutdown_after_h) {
    Json campaigns = Json::array(), coefficients = Json::array(), outliers = Json::array();
    for (std::size_t i = 0; i < trend.campaigns.size(); ++i) {
        const auto& one = trend.campaigns[i];
        campaigns.push_back({{"campaign", one.key},
                             {"name", one.name},
                             {"started", iso_text(one.started_utc_ns)},
                             {"rig", one.rig},
                             {"verdict", one.verdict.empty() ? Json(nullptr) : Json(one.verdict)},
                             {"simulated", one.simulated},
                             {"turn_on", trend.turn[i] + 1}});
    }
    for (const auto& of : trend.coefficients) {
        const char* const name = estimator::parameter_names()[of.position];
        Json points = Json::array();
        for (const auto& point : of.points) {
            const std::string& campaign = trend.campaigns[point.campaign].key;
            points.push_back({{"campaign", campaign},
                              {"value", point.of.value},
                              {"u", point.of.u},
                              {"u_repeat", point.u},
                              {"expanded", point.of.expanded},
                              {"low", point.of.value - point.of.expanded},
                              {"high", point.of.value + point.of.expanded},
                              {"t", number_or_null(point.t)},
                              {"p", number_or_null(point.p)},
                              {"outlier", point.outlier}});
            if (point.outlier)
                outliers.push_back({{"campaign", campaign},
                                    {"coefficient", name},
                                    {"value", point.of.value},
                                    {"t", number_or_null(point.t)},
                                    {"p", number_or_null(point.p)}});
        }
        coefficients.push_back({{"name", name},
                                {"unit", estimator::parameter_unit(of.position)},
                                {"at_hz", at_hz_json(of.at_hz)},
                                {"mean", of.mean},
                                {"interval", {of.mean_low, of.mean_high}},
                                {"operating_instability", instability_json(of.operating)},
                                {"shutdown_instability", instability_json(of.shutdown)},
                                {"points", std::move(points)}});
    }
    const std::string type = trend.campaigns.empty() ? "" : trend.campaigns.back().unit_type;
    return {{"unit", {{"type", text_or_null(type)}, {"serial", serial}}},
            {"simulated", trend.simulated},
            {"shutdown_after_h", shutdown_after_h},
            {"campaigns", std::move(campaigns)},
            {"left_out", trend.left_out},
            {"on_other_rigs", trend.elsewhere},
            {"vibration", text_or_null(vibration_words(trend))},
            {"of_other_vibration", trend.of_other_vibration},
            {"coefficients", std::move(coefficients)},
            {"outliers", std::move(outliers)}};
}

std::string trend_table(const std::string& serial, const archive::Trend& trend,
                        double shutdown_after_h) {
    const std::size_t turns = trend.turn.empty() ? 0 : trend.turn.back() + 1;
    std::string text =
        simulated_line(trend.simulated) +
        printed("unit %s: %zu campaigns in %zu turn-ons (a pause of more than %g h is a shutdown)",
                serial.c_str(), trend.campaigns.size(), turns, shutdown_after_h);
    if (trend.left_out > 0)
        text += "; " + std::to_string(trend.left_out) + " not valid or without a result left out";
    if (trend.elsewhere > 0)
        text += "; " + std::to_string(trend.elsewhere) +
                (trend.simulated ? " on real rigs" : " on simulated rigs") + " left out";
    if (const auto words = vibration_words(trend); !words.empty()) text += "\n" + words;
    text +=
        "\n\ncoefficient        mean   95 % interval             operating     shutdown       "
        "newest"
        "    +- U\n";
    for (const auto& of : trend.coefficients) {
        const auto& newest = of.points.back();
        text += line("%-7s %15.5f   %10.5f .. %-10.5f  %s  %s  %11.5f  %8.5f  %s%s",
                     estimator::parameter_names()[of.position], of.mean, of.mean_low, of.mean_high,
                     instability_text(of.operating).c_str(), instability_text(of.shutdown).c_str(),
                     newest.of.value, newest.of.expanded, estimator::parameter_unit(of.position),
                     newest.outlier ? "  outlier" : "");
    }
    text += "\n* F test: p below 0.01 without the instability\n";
    for (const auto& of : trend.coefficients)
        for (const auto& point : of.points) {
            if (!point.outlier) continue;
            text += line("outlier: %s of %s, %s: %.5f, t = %.1f against the others, p = %.2g",
                         estimator::parameter_names()[of.position],
                         trend.campaigns[point.campaign].key.c_str(),
                         minute_text(trend.campaigns[point.campaign].started_utc_ns).c_str(),
                         point.of.value, point.t, point.p);
        }
    return text;
}

std::string trend_chart(const archive::Trend& trend, const archive::CoefficientTrend& of) {
    const std::string name = estimator::parameter_names()[of.position];
    plot::Chart chart{mark_of(trend) + name + " over the campaigns", plot::Axis(time_axis(trend)),
                      plot::Axis(name + ", " + estimator::parameter_unit(of.position))};
    plot::Curve usual{.name = "value with U", .look = plot::Look::dots};
    plot::Curve outlying{.name = "outlier", .look = plot::Look::dots};
    for (const auto& point : of.points) {
        plot::Curve& to = point.outlier ? outlying : usual;
        to.add(days_of(trend, point), point.of.value, point.of.value - point.of.expanded,
               point.of.value + point.of.expanded);
    }
    const double last = days_of(trend, of.points.back());
    chart.curves.push_back(usual);
    if (!outlying.x.empty()) chart.curves.push_back(outlying);
    chart.curves.push_back(plot::level_line("mean", 0, last, of.mean));
    chart.curves.push_back(plot::level_line("its 95 % interval", 0, last, of.mean_low));
    chart.curves.push_back(plot::level_line("", 0, last, of.mean_high));
    return chart.svg();
}

void plot_trend(const std::string& serial, const archive::Trend& trend, const std::string& path) {
    plot::Chart chart{mark_of(trend) + "unit " + serial + ": all coefficients",
                      plot::Axis(time_axis(trend)), plot::Axis("(value - mean) / u")};
    for (const auto& of : trend.coefficients) {
        plot::Curve curve;
        for (const auto& point : of.points) {
            curve.add(days_of(trend, point), (point.of.value - of.mean) / point.u);
        }
        chart.curves.push_back(std::move(curve));
    }
    plot::Pictures pictures{{"all", chart.svg()}};
    for (const auto& of : trend.coefficients)
        pictures.emplace_back(estimator::parameter_names()[of.position], trend_chart(trend, of));
    plot::write_pictures(path, pictures);
}

}  // namespace vibrig::tool
