#include <pthread.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstring>
#include <iostream>
#include <sstream>

#include "daemon/campaign_forecast.hpp"
#include "daemon/daemon.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/version.hpp"
#include "estimator/instruction_set.hpp"

namespace {

void set_up_log(const vibrig::configuration::Configuration& configuration) {
    if (!configuration.log_file.empty()) {
        spdlog::set_default_logger(spdlog::basic_logger_mt("vibrigd", configuration.log_file));
    } else {
        spdlog::set_default_logger(spdlog::stderr_color_mt("vibrigd"));
    }
    spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %v", spdlog::pattern_time_type::utc);
    spdlog::set_level(spdlog::level::from_str(configuration.log_level));
    spdlog::flush_on(spdlog::level::info);
}

int run(vibrig::configuration::Loaded loaded, const sigset_t& signals) {
    const auto socket = loaded.configuration.socket;
    vibrig::Daemon daemon(std::move(loaded));
    // Before anything moves: it refuses to run beside another vibrigd.
    const vibrig::serve::StatusServer server(daemon, socket);
    daemon.start();
    spdlog::info("vibrigd {} answers at {}; measuring, shaker disarmed", vibrig::kVersion, socket);
    int signal = 0;
    ::sigwait(&signals, &signal);
    spdlog::info("{}: stopping", ::strsignal(signal));
    daemon.shut_down();
    // In wall time: the rig's clock may stand still, a link may be gone. A second signal cuts it
    // short.
    bool orderly = false;
    const timespec at_once{};
    for (double left = daemon.longest_end_s(); left > 0 && !orderly; left -= 0.1) {
        orderly = daemon.wait_for_end(0.1);
        if (::sigtimedwait(&signals, nullptr, &at_once) > 0) break;
    }
    daemon.join();
    if (!orderly) {
        spdlog::error("ended without the shaker read back at rest: its watchdog stops it");
        return 1;
    }
    spdlog::info("stopped cleanly");
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Acquisition and identification daemon for vibration rigs", "vibrigd"};
    app.footer("Example: vibrigd --config /etc/vibrig/vibrigd.toml --check");
    app.set_version_flag("--version", vibrig::kVersion);
    std::string path;
    bool check = false;
    bool schema = false;
    app.add_option("--config", path, "configuration file (TOML); all defaults without one");
    app.add_flag("--check", check,
                 "validate, print the effective configuration with units and origins, and end");
    app.add_flag("--schema", schema,
                 "print every key with type, unit, default and bounds, and end");
    std::string instruction_set = "auto";
    app.add_option("--instruction-set", instruction_set,
                   "of the filter: auto (the best), or one of this processor's")
        ->envname("VIBRIG_INSTRUCTION_SET");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    }

    // Blocked before any thread starts, so that sigwait in the main thread gets them all.
    sigset_t signals;
    ::sigemptyset(&signals);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaddset(&signals, signal);
    ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    std::signal(SIGPIPE, SIG_IGN);

    try {
        vibrig::estimator::use_instruction_set(instruction_set);
        if (schema) {
            std::cout << vibrig::configuration::format_schema();
            return 0;
        }
        auto loaded = vibrig::configuration::load(path, true);
        if (check) {
            vibrig::Daemon::check_bindings(loaded.configuration);
            std::cout << vibrig::configuration::format_effective(loaded);
            // As comments: what stands above reads back as a configuration.
            std::istringstream forecast(vibrig::forecast_campaign(loaded.configuration));
            for (std::string line; std::getline(forecast, line);) {
                std::cout << "# " << line << '\n';
            }
            for (const std::string& line : vibrig::Daemon::check_plan(loaded.configuration)) {
                std::cerr << "warning: campaign: " << line << '\n';
            }
            if (const auto& why = loaded.configuration.campaign.refusal; !why.empty()) {
                std::cerr << "warning: campaign: will not be armed: " << why << '\n';
            }
            return 0;
        }
        set_up_log(loaded.configuration);
        spdlog::info("campaign \"{}\": {}", loaded.configuration.campaign.name,
                     vibrig::forecast_campaign(loaded.configuration));
        return run(std::move(loaded), signals);
    } catch (const std::exception& error) {
        std::cerr << "vibrigd: " << error.what() << '\n';
        return 2;
    }
}
