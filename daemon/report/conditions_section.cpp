#include "daemon/report/sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "daemon/plot/chart.hpp"

namespace vibrig::report {

using tool::plot::Axis;
using tool::plot::Chart;
using tool::plot::Curve;
using tool::plot::Look;

namespace {
constexpr std::array<Look, 3> kSensorLooks{Look::dashed, Look::dots, Look::line};
constexpr std::size_t kMostRows = 600;
}  // namespace

void add_conditions(Page& page, const record::Campaign& campaign) {
    page.section("conditions", "Conditions");
    const auto& rows = campaign.conditions;
    if (rows.size() < 2 || campaign.samples.empty())
        return page.paragraph("None were recorded beside the samples.");
    const double origin = drivers::to_seconds(campaign.samples.front().time);
    const std::size_t every = std::max<std::size_t>(1, rows.size() / (kMostRows));
    const auto curve = [&](const char* name, Look look, const auto& value) {
        Curve made{.name = name, .look = look};
        for (std::size_t i = 0; i < rows.size(); i += every) {
            made.add(drivers::to_seconds(rows[i].time) - origin, value(rows[i]));
        }
        return made;
    };
    const auto known = [](const Curve& c) {
        return std::ranges::any_of(c.y, [](double y) { return std::isfinite(y); });
    };
    Chart temperature{.title = "Temperatures", .x = Axis("time, s"), .y = Axis("degC")};
    temperature.curves = {
        curve("inner element", Look::line, [](const auto& r) { return r.temperature_c; })};
    for (std::size_t k = 0; k < drivers::kTemperatureSensors.size(); ++k)
        temperature.curves.push_back(curve(drivers::kTemperatureSensors[k], kSensorLooks[k % 3],
                                           [k](const auto& r) { return r.sensor_c[k]; }));
    std::erase_if(temperature.curves, [&](const Curve& c) { return !known(c); });
    if (!temperature.curves.empty())
        page.figure(temperature.svg(), "As the platform reports them; gaps: it did not.");
    Chart shaker{.title = "Shaker: command and read-back",
                 .x = Axis("time, s"),
                 .y = Axis("peak at the table, g")};
    shaker.curves = {
        curve("commanded", Look::line, [](const auto& r) { return r.command_g; }),
        curve("set-point read back", Look::dashed, [](const auto& r) { return r.set_point_g; }),
        curve("controller measures", Look::dots, [](const auto& r) { return r.measured_g; })};
    page.figure(shaker.svg(), "Once a second.");
}

void add_zeros(Page& page, const record::Campaign& campaign) {
    Rows rows{{"from run, position", "zero x mg", "y", "z", "vertical uncertain by, ppm"}};
    const record::Order* before = nullptr;
    for (const auto& order : campaign.orders) {
        const bool none = order.zero_g == std::array<double, 3>{};
        if (order.cancel || (before == nullptr ? none : before->zero_g == order.zero_g)) continue;
        rows.push_back({fmt::format("{}, {}", order.run, order.position),
                        fmt::format("{:.4f}", 1e3 * order.zero_g[0]),
                        fmt::format("{:.4f}", 1e3 * order.zero_g[1]),
                        fmt::format("{:.4f}", 1e3 * order.zero_g[2]),
                        fmt::format("{:.1f}", 1e6 * order.level_sigma_g)});
        before = &order;
    }
    if (rows.size() == 1) return page.paragraph("None were taken in place.");
    page.paragraph("Taken in place, on top of them, and subtracted from every sample since:");
    page.table(rows);
}

}  // namespace vibrig::report
