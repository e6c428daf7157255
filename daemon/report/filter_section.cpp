#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "daemon/plot/chart.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::report {

using record::Campaign;
using tool::plot::Axis;
using tool::plot::Chart;
using tool::plot::Curve;
using tool::plot::Look;

namespace {

constexpr std::array<const char*, 3> kGyro{"x", "y", "z"};
constexpr std::array<const char*, 3> kAxis{"outer", "inner", "azimuth"};
constexpr std::array<Look, 3> kLooks{Look::line, Look::dashed, Look::dots};
constexpr std::size_t kMostPoints = 300;
constexpr std::size_t kApart = 24;  // dots that mark a curve

constexpr std::array<const char*, 3> kOrders{"Biases", "Linear terms", "Quadratic terms"};

/// Places within a gyro of the coefficients of one order.
std::vector<std::size_t> of_order(std::size_t order) {
    std::vector<std::size_t> places;
    for (std::size_t k = 0; k < estimator::kGroups; ++k)
        if (estimator::order_of(k) == order) places.push_back(k);
    return places;
}

/// Rows of the estimates that a chart shows.
std::size_t every_of(const std::vector<record::EstimateRow>& rows) {
    return std::max<std::size_t>(1, rows.size() / kMostPoints);
}

Chart deviations(const Campaign& campaign, std::size_t order) {
    const auto& rows = campaign.estimates;
    const double origin = origin_s(campaign);
    const auto places = of_order(order);
    Chart chart{.title = std::string(kOrders[order]) + ": standard deviation",
                .x = Axis("time, s"),
                .y = Axis(std::string("1 sigma, ") + estimator::parameter_unit(places[0]), true)};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        // The best and the worst of a gyro; all between them.
        Curve curve{.name = std::string("gyro ") + kGyro[gyro]};
        // One term each is the same for all three, often: none may hide another, and dots stand
        // far enough apart for the lines between them.
        if (places.size() == 1) curve.look = kLooks[gyro];
        const std::size_t step = curve.look == Look::dots
                                     ? std::max(every_of(rows), rows.size() / kApart)
                                     : every_of(rows);
        for (std::size_t i = 0; i < rows.size(); i += step) {
            double least = std::numeric_limits<double>::infinity(), most = 0, log_sum = 0;
            for (const std::size_t k : places) {
                const double s = rows[i].sigma[gyro * estimator::kGroups + k];
                least = std::min(least, s);
                most = std::max(most, s);
                log_sum += std::log(std::max(s, 1e-300));
            }
            curve.add(drivers::to_seconds(rows[i].time) - origin,
                      std::exp(log_sum / static_cast<double>(places.size())));
            if (places.size() == 1) continue;
            curve.low.push_back(least);
            curve.high.push_back(most);
        }
        chart.curves.push_back(std::move(curve));
    }
    return chart;
}

Chart distances(const Campaign& campaign, const Coefficients& last) {
    const auto& rows = campaign.estimates;
    const double origin = origin_s(campaign);
    Chart chart{.title = "Estimates on the way to their final values",
                .x = Axis("time, s"),
                .y = Axis("distance from the final value, final sigmas", true)};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        Curve curve{.name = std::string("gyro ") + kGyro[gyro]};
        for (std::size_t i = 0; i < rows.size(); i += every_of(rows)) {
            double square = 0;
            for (std::size_t k = 0; k < estimator::kGroups; ++k) {
                const std::size_t p = gyro * estimator::kGroups + k;
                const double d = (rows[i].value[p] - last.value[p]) / last.sigma[p];
                square += d * d / estimator::kGroups;
            }
            curve.add(drivers::to_seconds(rows[i].time) - origin, std::sqrt(square));
        }
        chart.curves.push_back(std::move(curve));
    }
    return chart;
}

/// Two level lines, one either way.
void add_limits(Chart& chart, const char* name, double from, double to, double limit) {
    for (const double sign : {-1.0, 1.0}) {
        Curve curve{.name = sign > 0 ? name : "", .look = Look::dashed};
        curve.x = {from, to};
        curve.y = {sign * limit, sign * limit};
        chart.curves.push_back(std::move(curve));
    }
}

Chart over_time(const Innovations& found) {
    Chart chart{.title = "Innovations", .x = Axis("time, s"), .y = Axis("arcsec")};
    for (std::size_t k = 0; k < 3; ++k) {
        Curve curve{.name = kAxis[k], .look = Look::dots};
        curve.x = found.time_s;
        curve.y = found.arcsec[k];
        chart.curves.push_back(std::move(curve));
    }
    const double band = 2 * std::max({found.deviation_arcsec[0], found.deviation_arcsec[1],
                                      found.deviation_arcsec[2]});
    add_limits(chart, "2 sigma", found.time_s.front(), found.time_s.back(), band);
    return chart;
}

void add_whiteness(Page& page, const Innovations& found) {
    Chart white{.title = "Whiteness: autocorrelation of the innovations",
                .x = Axis("lag, samples"),
                .y = Axis("correlation")};
    const double limit = k95 / std::sqrt(static_cast<double>(found.count));
    std::size_t outside = 0, all = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        Curve curve{.name = kAxis[k]};
        for (std::size_t lag = 1; lag < found.correlation[k].size(); ++lag) {
            curve.add(static_cast<double>(lag), found.correlation[k][lag]);
            ++all;
            if (std::abs(found.correlation[k][lag]) > limit) ++outside;
        }
        white.curves.push_back(std::move(curve));
    }
    const auto last =
        static_cast<double>(std::max<std::size_t>(2, found.correlation[0].size()) - 1);
    add_limits(white, "95 % if white", 1, last, limit);
    page.figure(white.svg(), fmt::format("{} of {} lie outside; 5 % are expected of white noise.",
                                         outside, all));
}

void add_nis(Page& page, const Analysis& a) {
    Chart nis{.title = "Normalised innovations squared, dwell by dwell",
              .x = Axis("dwell"),
              .y = Axis("per degree of freedom")};
    Curve values{.name = "dwell", .look = Look::dots}, low{.look = Look::dashed};
    Curve high{.name = "95 % if consistent", .look = Look::dashed};
    for (std::size_t i = 0; i < a.replayed.dwells.size(); ++i) {
        const auto& s = a.replayed.dwells[i].summary;
        if (s.used == 0) continue;
        // chi-square with 3 n degrees of freedom: variance 2 / (3 n) of its mean.
        const double spread = k95 * std::sqrt(2.0 / (3.0 * s.used));
        const auto x = static_cast<double>(i + 1);
        values.add(x, s.nis_per_dof);
        low.add(x, 1 - spread);
        high.add(x, 1 + spread);
    }
    nis.curves = {values, low, high};
    page.figure(nis.svg(), fmt::format("Over the campaign {:.4f}.", a.replayed.result.nis_per_dof));
}

}  // namespace

void add_convergence(Page& page, const Campaign& campaign, const Analysis& a) {
    page.section("convergence", "Convergence");
    if (campaign.estimates.size() < 2)
        return page.paragraph("No estimates were recorded along the way.");
    for (std::size_t order = 0; order < kOrders.size(); ++order)
        page.figure(
            deviations(campaign, order).svg(),
            order > 0 ? "Line: geometric mean of the gyro's terms; band: best to worst." : "");
    page.figure(distances(campaign, a.coefficients).svg(),
                "Root mean square over the ten coefficients of a gyro.");
}

void add_innovations(Page& page, const Analysis& a) {
    page.section("innovations", "Innovations");
    const Innovations& found = a.innovations;
    if (found.count == 0) return page.paragraph("No sample came into the filter.");
    if (!found.time_s.empty())
        page.figure(
            over_time(found).svg(),
            fmt::format("Every {}th of {} innovations.",
                        std::max<std::size_t>(1, found.count / found.time_s.size()), found.count));
    add_whiteness(page, found);
    add_nis(page, a);
}

void add_noise(Page& page, const Campaign& campaign, const Analysis& a) {
    page.section("noise", "Gyro noise");
    Chart chart{.title = "Allan deviation of the residual rates",
                .x = Axis("averaging time, s", true),
                .y = Axis("deg/h", true)};
    for (std::size_t k = 0; k < 3; ++k) {
        Curve curve{.name = std::string("gyro ") + kGyro[k]};
        for (const auto& point : a.allan[k]) {
            curve.add(point.tau, point.dev, point.lo, point.hi);
        }
        curve.look = Look::dots;
        chart.curves.push_back(std::move(curve));
    }
    page.figure(chart.svg(),
                "Measured, overlapping, of one-second means, from all dwells together, with 68 % "
                "bars. At short times the resolvers, at long times the gyros.");
    std::size_t alarms = 0;
    for (const auto& event : campaign.events) {
        if (event.source != "noise") continue;
        page.paragraph(event.text);
        if (event.severity != Severity::info) ++alarms;
    }
    page.paragraph(fmt::format("Alarms of the noise monitor: {}.", alarms));
}

}  // namespace vibrig::report
