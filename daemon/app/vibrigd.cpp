#include <pthread.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstring>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/app/campaign_forecast.hpp"
#include "daemon/app/daemon.hpp"
#include "daemon/app/start_checks.hpp"
#include "daemon/app/watchdog.hpp"
#include "daemon/configuration/forms.hpp"
#include "daemon/configuration/warnings.hpp"
#include "daemon/lock/rig_lock.hpp"
#include "daemon/log/log_sink.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/rt/real_time.hpp"
#include "daemon/serve/openapi.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/status/upgrade.hpp"
#include "daemon/version.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "proto/command_tree.hpp"
#include "proto/dbc.hpp"
#include "proto/empty_value.hpp"
#include "proto/json_text.hpp"
#include "proto/shipped_text.hpp"

namespace {

vibrig::serve::ServerSettings settings_of(const vibrig::configuration::Configuration& c) {
    vibrig::serve::ServerSettings settings{
        c.socket,      c.server.operator_group, c.server.status_socket,
        c.server.page, c.server.remote,         c.server.certificate,
        c.server.key,  c.server.clients_ca,     c.server.revoked};
    // Of each of four doors: together they leave descriptors for everything else below 1024, and
    // no key lifts it, since libmodbus waits with select(), which takes none above that.
    settings.limits.connections = 224;
    return settings;
}

std::string words_of(const vibrig::StatusData& status) {
    std::string words = std::string("measuring; campaign ") + vibrig::name_of(status.state);
    if (!status.reason.empty()) words += ": " + status.reason;
    if (status.position > 0)
        words += fmt::format(", run {} of {}, position {} of {}", status.run, status.runs,
                             status.position, status.positions);
    // The package's scripts read this.
    return words + "; table " + status.rest.state;
}

/// Throws configuration::ConfigurationError where the campaign cannot determine what is asked.
void insist(const vibrig::CampaignForecast& forecast) {
    if (!forecast.refusal.empty())
        throw vibrig::configuration::ConfigurationError(forecast.refusal);
}

/// The file as it is now; what is in force changes with a restart only, since another
/// configuration ends an arming.
void check_again(const std::string& path) {
    try {
        const auto loaded = vibrig::configuration::load(path, true);
        vibrig::check_bindings(loaded);
        vibrig::check_results(loaded);
        vibrig::check_named(loaded);
        if (const auto why = vibrig::missing_group(loaded); !why.empty())
            throw vibrig::configuration::ConfigurationError(why);
        insist(vibrig::forecast_campaign(loaded.configuration));
        spdlog::info("configuration checked: valid; it takes effect with the next start");
    } catch (const std::exception& error) {
        spdlog::error("configuration checked, the old one stays in force: {}", error.what());
    }
}

/// Whether an upgrade has asked for a restart and may have it now. Why it has to wait is logged
/// whenever that changes.
bool starts_again(const vibrig::Daemon& daemon, std::string& waits_for) {
    static const std::string request = vibrig::restart_request_file();
    if (request.empty() || ::access(request.c_str(), F_OK) != 0) return false;
    const auto why = vibrig::restart_waits_for(daemon.status());
    if (why == waits_for && !why.empty()) return false;
    waits_for = why;
    if (!why.empty()) {
        spdlog::warn("a new version is installed; the restart waits for rest: {}", why);
        return false;
    }
    // One that cannot be removed would be found again after each restart.
    if (::unlink(request.c_str()) == 0) return true;
    spdlog::error("cannot remove {}: no restart", request);
    return false;
}

/// Feeds the service manager's watchdog while every stage makes progress; returns the signal that
/// ends the daemon, or 0: it is to be started again.
int watch(vibrig::Daemon& daemon, const vibrig::ServiceManager& manager, vibrig::RigLock& lock,
          const sigset_t& signals, const std::string& path) {
    std::string reported, stuck, waits_for;
    for (;;) {
        const double period_s = manager.period_s() > 0 ? std::min(1.0, manager.period_s()) : 1.0;
        timespec wait{};
        wait.tv_sec = static_cast<time_t>(period_s);
        wait.tv_nsec = static_cast<long>((period_s - static_cast<double>(wait.tv_sec)) * 1e9);
        const int signal = ::sigtimedwait(&signals, nullptr, &wait);
        lock.answer();
        if (signal == SIGHUP) {
            manager.reloading();
            check_again(path);
            manager.ready(reported);
            continue;
        }
        if (signal > 0) return signal;
        const auto now_stuck = daemon.stuck_stage();
        if (now_stuck != stuck && !now_stuck.empty())
            spdlog::error("no progress in: {}; the watchdog is not fed", now_stuck);
        stuck = now_stuck;
        if (stuck.empty()) manager.alive();
        if (starts_again(daemon, waits_for)) return 0;
        if (auto words = stuck.empty() ? words_of(daemon.status()) : "no progress in " + stuck;
            words != reported) {
            reported = std::move(words);
            manager.status(reported);
        }
    }
}

/// Nobody logs after this. Whoever does not read the log does not keep the daemon from ending.
class LogEnd {
  public:
    explicit LogEnd(vibrig::log::LogQueue& queue) : queue_(queue) {}
    ~LogEnd() {
        constexpr auto kPatience = std::chrono::seconds(2);
        queue_.end(kPatience);
        spdlog::shutdown();
    }
    LogEnd(const LogEnd&) = delete;
    LogEnd& operator=(const LogEnd&) = delete;

  private:
    vibrig::log::LogQueue& queue_;
};

int run(vibrig::configuration::Loaded loaded, const vibrig::log::LogQueue& log,
        const sigset_t& signals, const std::string& path) {
    const vibrig::ServiceManager manager;
    // Before anything is opened, and long before anything is ordered to stop.
    vibrig::RigLock lock(loaded.configuration, path);
    // What an upgrade asked of the daemon before this one.
    if (const auto request = vibrig::restart_request_file(); !request.empty())
        ::unlink(request.c_str());
    const auto socket = loaded.configuration.socket;
    const auto server_settings = settings_of(loaded.configuration);
    vibrig::Daemon daemon(std::move(loaded), &log);
    // Before anything moves: it refuses to run beside another vibrigd.
    vibrig::serve::StatusServer server(daemon, server_settings);
    daemon.start();
    server.answer();
    spdlog::info("vibrigd {} answers at {}; measuring, shaker disarmed", vibrig::kVersion, socket);
    if (const auto page = server.page_address(); !page.empty()) spdlog::info("live page: {}", page);
    if (const auto remote = server.remote_address(); !remote.empty())
        spdlog::info("remote, with certificates: {}", remote);
    manager.ready(words_of(daemon.status()));
    const int signal = watch(daemon, manager, lock, signals, path);
    // Then files are closed.
    constexpr double kClosing_s = 30;
    manager.stopping(daemon.longest_end_s() + kClosing_s);
    spdlog::info("{}: stopping", signal == 0 ? "a new version is installed" : ::strsignal(signal));
    daemon.shut_down();
    // In wall time: the rig's clock may stand still, a link may be gone. A second signal cuts it
    // short.
    bool orderly = false;
    const timespec at_once{};
    for (double left = daemon.longest_end_s(); left > 0 && !orderly; left -= 0.1) {
        orderly = daemon.wait_for_end(0.1);
        lock.answer();
        if (::sigtimedwait(&signals, nullptr, &at_once) > 0) break;
    }
    const std::string moving = orderly ? std::string() : daemon.what_moves();
    daemon.join();
    if (!orderly) {
        spdlog::error(
            "ended without rest measured ({}): its watchdog stops it if it works; if the table "
            "moves on, press the emergency stop",
            moving);
        return 1;
    }
    spdlog::info("stopped cleanly");
    return signal == 0 ? vibrig::kStartAgain : 0;
}

/// What is only printed: a flag for each.
struct Print {
    const char* flag;
    const char* text;
    std::string (*words)();
    bool asked = false;
};

using Prints = std::array<Print, 6>;

Prints prints() {
    return {{{"--schema", "print every key with type, unit, default and bounds, and end",
              vibrig::configuration::format_schema},
             {"--json-schema", "print the JSON Schema of the configuration file, for editors",
              vibrig::configuration::format_json_schema},
             {"--init", "print a commented configuration of the keys that a rig needs, with blanks",
              vibrig::configuration::format_essentials},
             {"--print-dbc", "print the built-in rig.dbc: the messages of the bus",
              [] { return std::string(vibrig::proto::rig_dbc_text()); }},
             {"--print-proto", "print vibrig.proto: status and commands on the wire",
              [] { return std::string(vibrig::proto::vibrig_proto_text()); }},
             {"--print-openapi", "print the OpenAPI description of the HTTP interface",
              [] { return vibrig::serve::openapi_json() + "\n"; }}}};
}

/// What is doubtful of a configuration that is valid.
std::vector<std::string> warnings_of(const vibrig::configuration::Loaded& loaded) {
    auto out = vibrig::configuration::warnings(loaded);
    if (const auto why = vibrig::missing_group(loaded); !why.empty())
        out.push_back(why + "; a start on this machine is refused");
    for (std::string& line : vibrig::slow_statuses(loaded)) out.push_back(std::move(line));
    for (const std::string& line : vibrig::check_plan(loaded.configuration))
        out.push_back("campaign: " + line);
    return out;
}

/// --check: the effective configuration, and what can be said of its campaign.
void print_check(const vibrig::configuration::Loaded& loaded, bool as_json) {
    vibrig::check_bindings(loaded);
    vibrig::check_results(loaded);
    const auto effective = vibrig::configuration::format_effective(loaded);
    const auto sha256 = vibrig::record::sha256_of_text(effective);
    const auto forecast = vibrig::forecast_campaign(loaded.configuration);
    const auto warnings = warnings_of(loaded);
    std::vector<std::string> words;
    std::istringstream lines(forecast.words);
    for (std::string line; std::getline(lines, line);) words.push_back(line);
    if (as_json) {
        const nlohmann::ordered_json all{
            {"sha256", sha256},
            {"forecast", words},
            {"refusal", forecast.refusal},
            {"warnings", warnings},
            {"configuration", vibrig::configuration::effective_json(loaded)}};
        std::cout << vibrig::proto::json_text(all, 2) << '\n';
    } else {
        // As comments: what stands above reads back as a configuration.
        std::cout << effective << "# SHA-256 of what stands above: " << sha256 << '\n';
        for (const std::string& line : words) std::cout << "# " << line << '\n';
    }
    for (const std::string& line : warnings) std::cerr << "warning: " << line << '\n';
    insist(forecast);
}

/// Each is an answer of its own. Throws.
void insist_on_one(const Prints& prints, bool check) {
    std::string asked = check ? "--check" : "";
    for (const Print& print : prints) {
        if (!print.asked) continue;
        if (!asked.empty())
            throw std::runtime_error("found " + asked + " with " + print.flag +
                                     ", expected one of them");
        asked = print.flag;
    }
}

constexpr std::initializer_list<vibrig::proto::Exit> kExits{
    {0, "ended cleanly, rest measured; or what was asked for is printed"},
    {1, "ended without rest measured: the log says what moves"},
    {2, "bad usage or configuration, or another daemon has this rig"},
    {75, "ended at rest for an upgrade; the service manager starts the new version"}};

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): before anything runs only memory can be short
int main(int argc, char** argv) {
    vibrig::rt::give_large_blocks_back();
    CLI::App app{"Acquisition and identification daemon for vibration rigs", "vibrigd"};
    app.footer("Example: vibrigd --config /etc/vibrig/vibrigd.toml --check");
    app.set_version_flag("--version", std::string("vibrigd ") + vibrig::kVersion);
    std::string path;
    bool check = false, as_json = false;
    app.add_option("--config", path, "configuration file (TOML); all defaults without one");
    auto* const checks =
        app.add_flag("--check", check,
                     "validate, print the effective configuration with units and origins, and end");
    app.add_flag("--json", as_json, "with --check: as JSON, for machines")->needs(checks);
    auto printable = prints();
    for (Print& print : printable) app.add_flag(print.flag, print.asked, print.text);
    std::string instruction_set = "auto";
    app.add_option("--instruction-set", instruction_set,
                   "of the filter: auto (the best), or one of this processor's")
        ->envname("VIBRIG_INSTRUCTION_SET");
    vibrig::proto::refuse_empty_values(app);
    if (vibrig::proto::asks_for_command_tree(argc, argv)) {
        std::cout << vibrig::proto::command_tree_json(app, kExits);
        return vibrig::proto::print_status(app);
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? vibrig::proto::print_status(app) : 2;
    }

    // Blocked before any thread starts, so that sigwait in the main thread gets them all.
    sigset_t signals;
    ::sigemptyset(&signals);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaddset(&signals, signal);
    ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    // A file as large as is allowed is an answer of the disk, not the end.
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGPIPE, SIG_IGN);

    try {
        vibrig::estimator::use_instruction_set(instruction_set);
        insist_on_one(printable, check);
        for (const Print& print : printable) {
            if (!print.asked) continue;
            std::cout << print.words();
            return vibrig::proto::print_status(app);
        }
        auto loaded = vibrig::configuration::load(path, true);
        vibrig::check_named(loaded);
        if (check) {
            print_check(loaded, as_json);
            return vibrig::proto::print_status(app);
        }
        const auto& file = loaded.configuration.log_file;
        const int descriptor = file.empty() ? STDERR_FILENO : vibrig::log::open_log_file(file);
        vibrig::log::LogQueue log(descriptor);
        const LogEnd at_the_end(log);
        vibrig::log::log_through(log, loaded.configuration.log_level,
                                 vibrig::log::shows_colours(descriptor));
        const auto forecast = vibrig::forecast_campaign(loaded.configuration);
        spdlog::info("campaign \"{}\": {}", loaded.configuration.campaign.name, forecast.words);
        insist(forecast);
        return run(std::move(loaded), log, signals, path);
    } catch (const std::exception& error) {
        std::cerr << "vibrigd: " << error.what() << '\n';
        return 2;
    }
}
