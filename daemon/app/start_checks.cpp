// What can be said of a configuration before anything is opened.
#include "daemon/app/start_checks.hpp"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/zero_calibration.hpp"
#include "daemon/serve/socket_file.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/serve/tls.hpp"
#include "estimator/identification/plan_report.hpp"
#include "estimator/level/vibration_level.hpp"
#include "proto/text.hpp"

namespace vibrig {

proto::Dbc load_dbc(const std::string& path) {
    return path.empty() ? proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc")
                        : proto::read_dbc(path);
}

namespace {

/// Where a key is stated, "file:line: "; empty: nowhere, or there is no such key.
std::string place_of(const configuration::Loaded& loaded, const std::string& key) {
    const auto same = [&](const auto& value) { return value.key == key; };
    const auto value = std::ranges::find_if(loaded.effective, same);
    return value == loaded.effective.end() ? "" : value->origin + ": ";
}

/// Throws ConfigurationError where the cables do not let zeroing go.
void check_zeroing_travel(const configuration::Configuration& c) {
    if (!c.campaign.zeroing) return;
    const campaign::RigFrame frame(c.estimator);
    for (const auto& way : campaign::ways_of(c.campaign.zero)) {
        for (const auto& at : campaign::slews_of(way, frame)) {
            for (std::size_t i = 0; i < 3; ++i) {
                const auto& [low, high] = c.gimbal.travel_deg[i];
                if (high - low >= 360 || drivers::within_travel(at[i], {low, high})) continue;
                throw configuration::ConfigurationError(fmt::format(
                    "campaign.zeroing: found true, which needs a reading of {:g} deg of the {} "
                    "gimbal, expected {:g} to {:g} deg (gimbal.travel_deg)",
                    at[i], std::array{"outer", "inner", "azimuth"}[i], low, high));
            }
        }
    }
}

/// Whether a file, if there is one stated, can be read by whoever runs this; false: by others
/// alone. Throws ConfigurationError where it cannot be by anybody.
bool readable(const configuration::Loaded& loaded, const std::string& key, const std::string& file,
              const char* expected) {
    if (file.empty() || ::access(file.c_str(), R_OK) == 0) return true;
    if (errno == EACCES) return false;
    throw configuration::ConfigurationError(place_of(loaded, key) + key + ": found \"" + file +
                                            "\", expected " + expected + ": " +
                                            std::strerror(errno));
}

void check_certificates(const configuration::Loaded& loaded) {
    const auto& server = loaded.configuration.server;
    if (server.remote.empty()) return;
    for (const auto& [key, file] : {std::pair("server.certificate", server.certificate),
                                    {"server.key", server.key},
                                    {"server.clients_ca", server.clients_ca},
                                    {"server.revoked", server.revoked}})
        if (!readable(loaded, key, file, "a PEM file")) return;
    try {
        (void)serve::mutual_tls(server.certificate, server.key, server.clients_ca, true,
                                server.revoked);
    } catch (const serve::ServeError& error) {
        throw configuration::ConfigurationError(place_of(loaded, "server.remote") +
                                                "server.remote: " + error.what());
    }
}

void check_broker_files(const configuration::Loaded& loaded) {
    const auto& mqtt = loaded.configuration.mqtt;
    if (mqtt.host.empty()) return;
    for (const auto& [key, file] : {std::pair("mqtt.ca", mqtt.ca),
                                    {"mqtt.certificate", mqtt.certificate},
                                    {"mqtt.key", mqtt.key},
                                    {"mqtt.password_file", mqtt.password_file}})
        (void)readable(loaded, key, file, "a file that can be read");
}

/// The start makes these, but no folder for them other than that of the results.
void check_made_files(const configuration::Loaded& loaded) {
    const auto& c = loaded.configuration;
    // With the end that only a folder may have.
    const auto folder = [](const std::filesystem::path& path) {
        return std::filesystem::absolute(path).lexically_normal() / "";
    };
    for (const auto& [key, file] :
         {std::pair("journal.file", c.journal), {"log.file", c.log_file}}) {
        if (file.empty()) continue;
        const auto parent = folder(std::filesystem::absolute(file).parent_path());
        if ((!c.results.empty() && parent == folder(c.results)) ||
            ::access(parent.c_str(), W_OK | X_OK) == 0 || errno == EACCES)
            continue;
        throw configuration::ConfigurationError(
            place_of(loaded, key) + key + ": found \"" + file +
            "\", expected a file in a folder that is there: " + std::strerror(errno));
    }
}

}  // namespace

void check_bindings(const configuration::Loaded& loaded) {
    const auto& configuration = loaded.configuration;
    const auto dbc = load_dbc(configuration.dbc);
    boost::asio::io_context io;
    const auto port = drivers::make_can_port(io, configuration.can);
    std::string missing;
    const auto add = [&](const drivers::BindingError& error) {
        auto place = place_of(loaded, error.key());
        std::string text = error.what();
        // A default that another DBC does not have is the fault of that one's line.
        if (place == "default: " && !configuration.dbc.empty()) {
            place = place_of(loaded, "can.dbc");
            const auto end = text.find("\", expected");
            if (end != std::string::npos) text.insert(end + 1, " (default)");
        }
        missing += (missing.empty() ? "" : "\n") + place + text;
    };
    const auto collect = [&](const auto& bind) {
        try {
            bind();
        } catch (const drivers::BindingError& error) {
            if (error.all().empty()) add(error);
            for (const auto& one : error.all()) add(one);
        }
    };
    collect([&] {
        const drivers::SampleAssembler assembler(dbc, configuration.assembler,
                                                 [](const drivers::Sample&) {});
    });
    collect([&] { const drivers::Gimbal gimbal(dbc, configuration.gimbal, *port); });
    std::string why;
    collect([&] { why = campaign::check_stages(configuration.campaign, dbc, *port); });
    if (!missing.empty()) throw configuration::ConfigurationError(missing);
    if (!why.empty())
        throw configuration::ConfigurationError(place_of(loaded, why.substr(0, why.find(':'))) +
                                                why);
    check_zeroing_travel(configuration);
}

void check_results(const configuration::Loaded& loaded) {
    const std::string& folder = loaded.configuration.results;
    if (folder.empty()) return;
    // It is made when it is not there: then what counts is the folder that it is made in.
    auto there = std::filesystem::absolute(folder);
    std::error_code error;
    while (!std::filesystem::exists(there, error) && there.has_relative_path())
        there = there.parent_path();
    if (!std::filesystem::is_directory(there, error)) {
        errno = ENOTDIR;
    } else {
        auto trial = (there / ".vibrigd-check-XXXXXX").string();
        if (::mkdtemp(trial.data()) != nullptr) {
            ::rmdir(trial.c_str());
            return;
        }
    }
    const std::string why = there.string() + ": " + std::strerror(errno);
    throw configuration::ConfigurationError(place_of(loaded, "campaign.results") +
                                            "campaign.results: found \"" + folder +
                                            "\", expected a folder that can be written: " + why);
}

void check_named(const configuration::Loaded& loaded) {
    check_certificates(loaded);
    check_broker_files(loaded);
    check_made_files(loaded);
}

std::string missing_group(const configuration::Loaded& loaded) {
    const auto& group = loaded.configuration.server.operator_group;
    try {
        if (!group.empty()) (void)serve::group_named(group);
    } catch (const serve::ServeError& error) {
        return place_of(loaded, "server.operator_group") + error.what();
    }
    return {};
}

std::vector<std::string> slow_statuses(const configuration::Loaded& loaded) {
    const auto& c = loaded.configuration;
    if (c.simulated()) return {};
    const auto dbc = load_dbc(c.dbc);
    const double deadline_ms = 1e3 * drivers::to_seconds(c.gimbal.status_deadline);
    const auto& names = c.assembler.bindings;
    std::vector<std::string> warnings;
    for (const auto& [key, name] : {std::pair("can.signals.loop_closed", names.loop_closed),
                                    {"can.signals.fault", names.fault},
                                    {"can.signals.in_position", names.in_position},
                                    {"can.signals.slewing", names.slewing},
                                    {"can.signals.command_echo", names.command_echo}}) {
        const auto bound = drivers::bind_signal(dbc, key, name);
        if (!bound) continue;
        const auto cycle_ms = bound.message->cycle_time_ms;
        if (cycle_ms && *cycle_ms < deadline_ms) continue;
        const std::string how = cycle_ms ? fmt::format("comes each {} ms", *cycle_ms)
                                         : "has no GenMsgCycleTime, as one sent on change alone";
        warnings.push_back(fmt::format(
            "{}{}: found \"{}\", whose message by the DBC {}, expected one that comes within "
            "gimbal.status_deadline_ms = {:g} ms, changed or not: else stale_platform stops the "
            "table",
            place_of(loaded, key), key, name, how, deadline_ms));
    }
    return warnings;
}

std::vector<std::string> check_plan(const configuration::Configuration& configuration) {
    constexpr double kSameDwell = 1e-9;
    const campaign::Settings& campaign = configuration.campaign;
    std::vector<std::string> warnings;
    const auto& rig = configuration.estimator;
    if (rig.encoder_sign != std::array{1, 1, 1} ||
        rig.encoder_zero_deg != std::array{0.0, 0.0, 0.0})
        warnings.emplace_back(
            "positions of lists and plans are gimbal angles, converted by platform.encoder_sign "
            "and encoder_zero_deg: a file that states what the encoders show is to be mended");
    if (!campaign.plan_warning.empty()) warnings.push_back(proto::printable(campaign.plan_warning));
    if (const double planned_s = campaign.planned_dwell_s;
        planned_s > 0 && std::abs(planned_s - campaign.dwell_s) > kSameDwell * campaign.dwell_s)
        warnings.push_back(
            fmt::format("campaign.plan: {} was made for dwells of {:g} s, and campaign.dwell_s is "
                        "{:g} s: what it forecasts is not what this campaign will reach",
                        proto::printable(campaign.plan), planned_s, campaign.dwell_s));
    // Of a plan file and of an adaptive campaign the forecast tells.
    if (!campaign.stops.empty() || campaign.adaptive) return warnings;
    for (auto& line : estimator::plan_warnings(
             estimator::report_plan(rig,
                                    estimator::campaign_plan(rig, campaign.positions_deg,
                                                             campaign.table_g, campaign.dwell_s),
                                    drivers::to_seconds(configuration.assembler.sample_period))))
        warnings.push_back(std::move(line));
    const std::string alias = estimator::VibrationLevel::aliasing(
        rig.frequency_hz, drivers::to_seconds(configuration.assembler.sample_period),
        rig.level_window_s);
    if (!alias.empty()) warnings.push_back("vibration.frequency_hz: " + alias);
    return warnings;
}

}  // namespace vibrig
