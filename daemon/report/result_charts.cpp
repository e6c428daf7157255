#include "daemon/report/result_charts.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <utility>

#include "estimator/filter/parameters.hpp"

namespace vibrig::report {

using estimator::kParameters;
using estimator::uncertainty::Assessment;
using tool::plot::Axis;
using tool::plot::Chart;
using tool::plot::Curve;
using tool::plot::Look;

namespace {

/// Coefficients along an axis: as many names as there is room for.
void name_coefficients(Axis& axis, std::size_t every) {
    axis.exact = true;
    for (std::size_t i = 0; i < kParameters; i += every)
        axis.named.emplace_back(static_cast<double>(i + 1), estimator::parameter_names()[i]);
}

}  // namespace

Chart correlation_chart(const std::function<double(std::size_t, std::size_t)>& correlation) {
    Chart chart{.title = "Correlation of the coefficients",
                .x = Axis("coefficient, in the order of the table"),
                .y = Axis("coefficient")};
    name_coefficients(chart.x, 5);
    name_coefficients(chart.y, 2);
    tool::plot::HeatMap map;
    map.label = "absolute correlation";
    for (std::size_t i = 0; i <= kParameters; ++i) {
        map.x.push_back(static_cast<double>(i) + 0.5);
        map.y.push_back(static_cast<double>(i) + 0.5);
    }
    for (std::size_t i = 0; i < kParameters; ++i) {
        map.value.emplace_back();
        for (std::size_t j = 0; j < kParameters; ++j)
            map.value.back().push_back(std::abs(correlation(i, j)));
    }
    chart.maps.push_back(std::move(map));
    return chart;
}

Chart residuals_chart(const Assessment& of) {
    Chart chart{.title = "Residuals of the dwells' rates",
                .x = Axis("time since the first dwell, h"),
                .y = Axis("deg/h")};
    for (std::size_t j = 0; j < 3; ++j) {
        Curve curve{.name = fmt::format("gyro {}", "xyz"[j]), .look = Look::dots};
        for (const auto& dwell : of.rates) {
            curve.add(dwell.time_h, dwell.residual[j], dwell.residual[j] - dwell.residual_sigma[j],
                      dwell.residual[j] + dwell.residual_sigma[j]);
        }
        chart.curves.push_back(std::move(curve));
    }
    return chart;
}

Chart uncertainties_chart(const estimator::Result& result, const Assessment& of) {
    Chart chart{.title = "Standard uncertainty of the coefficients",
                .x = Axis("coefficient, in the order of the table"),
                .y = Axis("deg/h, deg/h/g, deg/h/g^2", true)};
    name_coefficients(chart.x, 5);
    chart.x.low = 0.5;
    chart.x.high = static_cast<double>(kParameters) + 0.5;
    Curve noise{.name = "sigma of noise alone", .look = Look::dots};
    Curve combined{.name = "combined, u", .look = Look::dots};
    for (std::size_t i = 0; i < kParameters; ++i) {
        for (auto* curve : {&noise, &combined}) curve->x.push_back(static_cast<double>(i + 1));
        const double sigma = of.over_frequency ? of.coefficients[i].noise : result.sigma[i];
        noise.y.push_back(result.observable[i] ? sigma : std::nan(""));
        combined.y.push_back(of.done && result.observable[i] ? of.coefficients[i].u : std::nan(""));
    }
    chart.curves = {std::move(noise), std::move(combined)};
    if (!of.verdict.sentence.empty()) chart.notes.push_back(of.verdict.sentence);
    return chart;
}

void plot_result(const std::string& path, const estimator::Result& result,
                 const Assessment& assessed, bool simulated) {
    const auto& p = result.covariance;
    const auto correlation = [&p](std::size_t i, std::size_t j) {
        return p[i][j] / std::sqrt(p[i][i] * p[j][j]);
    };
    const auto drawn = [simulated](Chart chart) {
        if (simulated) chart.title = "SIMULATED: " + chart.title;
        return chart.svg();
    };
    tool::plot::Pictures pictures{{"uncertainties", drawn(uncertainties_chart(result, assessed))},
                                  {"correlation", drawn(correlation_chart(correlation))}};
    if (assessed.done) pictures.emplace_back("residuals", drawn(residuals_chart(assessed)));
    tool::plot::write_pictures(path, pictures);
}

}  // namespace vibrig::report
