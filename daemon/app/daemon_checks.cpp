// What can be said of a configuration before anything is opened.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "daemon/app/daemon.hpp"
#include "estimator/identification/plan_report.hpp"

namespace vibrig {

proto::Dbc Daemon::load_dbc(const std::string& path) {
    return path.empty() ? proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc")
                        : proto::read_dbc(path);
}

void Daemon::check_bindings(const configuration::Loaded& loaded) {
    const auto& configuration = loaded.configuration;
    const auto dbc = load_dbc(configuration.dbc);
    boost::asio::io_context io;
    const auto port = drivers::make_can_port(io, configuration.can);
    std::string missing;
    const auto add = [&](const drivers::BindingError& error) {
        const auto same = [&](const auto& value) { return value.key == error.key(); };
        const auto value = std::ranges::find_if(loaded.effective, same);
        missing += (missing.empty() ? "" : "\n") +
                   (value == loaded.effective.end() ? "" : value->origin + ": ") + error.what();
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
    if (!missing.empty()) throw configuration::ConfigurationError(missing);
    const auto why = campaign::check_stages(configuration.campaign, dbc, *port);
    if (!why.empty()) throw configuration::ConfigurationError(why);
}

void Daemon::check_results(const configuration::Configuration& configuration) {
    const std::string& folder = configuration.results;
    if (folder.empty()) return;
    // It is made when it is not there: then what counts is the folder that it is made in.
    auto there = std::filesystem::absolute(folder);
    std::error_code error;
    while (!std::filesystem::exists(there, error) && there.has_relative_path())
        there = there.parent_path();
    if (!std::filesystem::is_directory(there, error)) {
        errno = ENOTDIR;
    } else if (::access(there.c_str(), W_OK | X_OK) == 0) {
        return;
    }
    throw configuration::ConfigurationError("campaign.results: found \"" + folder +
                                            "\", expected a folder that can be written: " +
                                            there.string() + ": " + std::strerror(errno));
}

std::vector<std::string> Daemon::check_plan(const configuration::Configuration& configuration) {
    const campaign::Settings& campaign = configuration.campaign;
    // Of a plan file and of an adaptive campaign the forecast tells.
    if (!campaign.stops.empty() || campaign.adaptive) return {};
    return estimator::plan_warnings(estimator::report_plan(
        configuration.estimator,
        estimator::campaign_plan(configuration.estimator, campaign.positions_deg, campaign.table_g,
                                 campaign.dwell_s),
        drivers::to_seconds(configuration.assembler.sample_period)));
}

}  // namespace vibrig
