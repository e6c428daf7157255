#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <exception>
#include <iostream>

#include "daemon/tool/commands.hpp"
#include "proto/command_tree.hpp"

namespace {

constexpr int kBadUsage = 2;

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Vibrig: gyro error coefficients of an inertial platform on a vibration rig.",
                 "vibrig"};
    app.set_version_flag("--version", "vibrig " VIBRIG_VERSION);
    app.require_subcommand(1);
    app.footer(
        "Example: vibrig identify recording.csv --config rig.toml\n"
        "`vibrig COMMAND --help` explains a command.\n"
        "Exit codes: 0 done, 1 the result says no, 2 bad usage or input.");
    int exit_code = 0;
    vibrig::tool::add_identify(app, exit_code);
    vibrig::tool::add_uncertainty(app, exit_code);
    vibrig::tool::add_allan(app, exit_code);
    vibrig::tool::add_plan(app, exit_code);
    vibrig::tool::add_predict(app, exit_code);
    vibrig::tool::add_calibrate(app, exit_code);
    vibrig::tool::add_level(app, exit_code);
    vibrig::tool::add_zero(app, exit_code);
    vibrig::tool::add_reproduce(app, exit_code);
    vibrig::tool::add_study(app, exit_code);
    vibrig::tool::add_replay(app, exit_code);
    vibrig::tool::add_recordings(app, exit_code);
    vibrig::tool::add_reports(app, exit_code);
    vibrig::tool::add_certificate(app, exit_code);
    vibrig::tool::add_list(app, exit_code);
    vibrig::tool::add_trend(app, exit_code);
    vibrig::tool::add_archive(app, exit_code);
    vibrig::tool::add_remote(app, exit_code);
    vibrig::tool::add_commission(app, exit_code);
    vibrig::tool::add_journal(app, exit_code);
    vibrig::tool::add_pki(app, exit_code);
    if (vibrig::proto::asks_for_command_tree(argc, argv)) {
        std::cout << vibrig::proto::command_tree_json(
            app, {{0, "done"}, {1, "the result says no"}, {kBadUsage, "bad usage or input"}});
        return 0;
    }
    // Of a word that it does not know CLI11 says only that there should be a command.
    const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
    const auto is_named = [&](const CLI::App* command) { return command->check_name(argv[1]); };
    if (argc > 1 && *argv[1] != '-' && std::ranges::none_of(commands, is_named)) {
        std::cerr << "vibrig: found \"" << argv[1]
                  << "\", expected a command; vibrig --help lists them\n";
        return kBadUsage;
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        // CLI11 has codes of its own for each kind of bad usage; people and scripts get one.
        return app.exit(error) == 0 ? 0 : kBadUsage;
    } catch (const std::exception& error) {
        std::cerr << "vibrig: " << error.what() << '\n';
        return kBadUsage;
    }
    return exit_code;
}
