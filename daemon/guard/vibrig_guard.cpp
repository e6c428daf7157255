#include <systemd/sd-daemon.h>

#include <CLI/CLI.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <iostream>

#include "daemon/guard/guard.hpp"
#include "proto/command_tree.hpp"
#include "proto/empty_value.hpp"

namespace {

using vibrig::guard::Guard;

/// Tells the service manager that the loop goes round.
class Pulse {
  public:
    Pulse(boost::asio::io_context& io, const Guard& guard) : timer_(io), guard_(guard) {}
    void beat() {
        ::sd_notify(0, ("WATCHDOG=1\nSTATUS=" + guard_.words()).c_str());
        timer_.expires_after(std::chrono::seconds(1));
        timer_.async_wait([this](const boost::system::error_code& error) {
            if (!error) beat();
        });
    }

  private:
    boost::asio::basic_waitable_timer<std::chrono::steady_clock> timer_;
    const Guard& guard_;
};

int complain(const std::exception& error, int status) {
    std::string text = error.what();
    while (!text.empty() && text.back() == '\n') text.pop_back();
    std::cerr << "vibrig-guard: " << text << '\n';
    return status;
}

void run(const vibrig::guard::Settings& settings) {
    boost::asio::io_context io{1};
    Guard guard(io, settings);
    boost::asio::signal_set ends(io, SIGTERM, SIGINT), acknowledges(io, SIGUSR1);
    ends.async_wait([&io](const boost::system::error_code&, int) { io.stop(); });
    std::function<void()> listen = [&] {
        acknowledges.async_wait([&](const boost::system::error_code& error, int) {
            if (error) return;
            guard.acknowledge();
            listen();
        });
    };
    listen();
    guard.start();
    vibrig::guard::say("info", "watching; vibrigd is awaited at " + settings.socket);
    ::sd_notify(0, "READY=1");
    Pulse pulse(io, guard);
    pulse.beat();
    io.run();
    ::sd_notify(0, "STOPPING=1");
    guard.stop();
    vibrig::guard::say("info", "ended");
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): before anything runs only memory can be short
int main(int argc, char** argv) {
    CLI::App app{
        "Watches vibrigd and the table from outside: stops the shaker and sounds the horn when "
        "they do not agree",
        "vibrig-guard"};
    app.footer("Example: vibrig-guard --config /etc/vibrig/vibrigd.toml --check");
    app.set_version_flag("--version", "vibrig-guard " VIBRIG_VERSION);
    std::string path;
    bool check = false;
    app.add_option("--config", path, "vibrigd's configuration file (TOML)")->required();
    app.add_flag("--check", check, "print what the guard takes from it, and end");
    vibrig::proto::refuse_empty_values(app);
    if (vibrig::proto::asks_for_command_tree(argc, argv)) {
        std::cout << vibrig::proto::command_tree_json(
            app, {{0, "ended, or the configuration is good"},
                  {1,
                   "what may be over with a later start: a name that is not resolved yet, a "
                   "place that another guard still has"},
                  {2, "bad usage or configuration"}});
        return vibrig::proto::print_status(app);
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? vibrig::proto::print_status(app) : 2;
    }
    std::signal(SIGPIPE, SIG_IGN);
    try {
        const auto settings = vibrig::guard::read_settings(path);
        if (check) {
            const vibrig::guard::Witnesses witnesses(settings.witness);
            std::cout << settings.believed;
            return vibrig::proto::print_status(app);
        }
        run(settings);
        return 0;
    } catch (const vibrig::guard::SettingsError& error) {
        return complain(error, 2);
    } catch (const vibrig::proto::DbcError& error) {
        return complain(error, 2);
    } catch (const vibrig::drivers::CanError& error) {
        return complain(error, 2);
    } catch (const std::exception& error) {
        // A name that is not resolved yet, a place that another guard still has: try again.
        return complain(error, 1);
    }
}
