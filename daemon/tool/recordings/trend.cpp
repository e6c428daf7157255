// vibrig trend: a unit's coefficients over its campaigns.
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "daemon/archive/trend.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "daemon/tool/recordings/trend_output.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

struct TrendOptions {
    std::string serial, since, plot;
    double shutdown_after_h = archive::kShutdownAfterH;
    std::optional<double> at_hz;
    bool simulated = false, json = false;
    ArchiveOptions where = {};
};

constexpr std::size_t kMostNamed = 12;

void unknown_unit(archive::Index& index, const std::string& serial) {
    std::string known;
    std::size_t count = 0;
    for (const auto& unit : index.units())
        if (!unit.serial.empty() && ++count <= kMostNamed) known += " " + unit.serial;
    throw std::runtime_error(
        index.name() + ": found no campaign of a unit with the serial number '" +
        proto::printable(serial) + "', " +
        (count == 0 ? "nor of any other"
                    : "expected one of" + known + (count > kMostNamed ? " ..." : "")));
}

int trend(const TrendOptions& o) {
    const auto index = open_index(o.where);
    // An empty filter is none: campaigns of many units are no unit's history.
    if (o.serial.empty()) unknown_unit(*index, o.serial);
    archive::Filter filter;
    filter.serial = o.serial;
    if (!o.since.empty()) filter.since_utc_ns = utc_of("--since", o.since);
    auto campaigns = index->results(filter);
    if (campaigns.empty() && !o.since.empty()) {
        filter.since_utc_ns = 0;
        if (const auto before = index->results(filter); !before.empty())
            throw std::runtime_error(index->name() + ": found no campaign of unit '" +
                                     proto::printable(o.serial) + "' since " + o.since +
                                     ", expected one: its newest is of " +
                                     minute_text(before.back().started_utc_ns));
    }
    if (campaigns.empty()) unknown_unit(*index, o.serial);
    archive::read_vibrations(*index, whereabouts_of(o.where).place.folder, campaigns);
    // Simulated ones are no history of a unit that was on a real rig.
    const bool simulated =
        o.simulated || std::ranges::all_of(campaigns, &archive::Entry::simulated);
    const auto found = archive::trend_of(std::move(campaigns), o.shutdown_after_h, simulated,
                                         archive::all_at(o.at_hz));
    if (found.campaigns.empty() && found.left_out == 0)
        throw std::runtime_error(index->name() + ": found " + std::to_string(found.elsewhere) +
                                 " campaigns of unit '" + proto::printable(o.serial) +
                                 "' on real rigs, expected one on a simulated rig: without "
                                 "--simulated");
    if (o.json) {
        std::cout << proto::json_text(trend_json(o.serial, found, o.shutdown_after_h)) << '\n';
    } else {
        std::cout << trend_table(o.serial, found, o.shutdown_after_h);
    }
    if (!o.plot.empty()) {
        if (found.coefficients.empty())
            throw std::runtime_error("--plot: nothing to draw, no chart was written");
        plot_trend(o.serial, found, o.plot);
    }
    return 0;
}

}  // namespace

void add_trend(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<TrendOptions>(
        app, exit_code, "trend", "A unit's coefficients over its campaigns", trend);
    command.add_option("SERIAL", options.serial, "the unit's serial number")->required();
    command.add_option("--since", options.since, "campaigns of this day and later, UTC");
    add_number(command, "--shutdown-after", options.shutdown_after_h,
               "a longer pause between two campaigns counts as a shutdown, h", 0, 1e6)
        ->capture_default_str();
    add_at_hz(command, options.at_hz);
    command.add_flag("--simulated", options.simulated,
                     "of campaigns on simulated rigs (default: on real ones, where there are any)");
    command.add_flag("--json", options.json, "print it as JSON");
    command
        .add_option("--plot", options.plot,
                    "an SVG file for all, or a folder for a chart of each coefficient")
        ->check(proto::charts());
    add_archive_options(command, options.where);
    command.footer(
        "Example: vibrig trend 0017 --archive /lab/archive --plot trend/\n"
        "Operating instability: scatter between campaigns without a shutdown, beyond what their\n"
        "uncertainty explains (F against it); shutdown instability: between turn-ons (F against "
        "the\n"
        "scatter within). Outliers: what the other campaigns allow once in 1000 such histories.\n"
        "Quadratic coefficients depend on the vibration: those of others are left out.\n"
        "Exit codes: 0, 2 bad usage or input.");
}

}  // namespace vibrig::tool
