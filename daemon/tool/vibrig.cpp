#include <algorithm>
#include <exception>
#include <iostream>

#include "daemon/tool/commands.hpp"
#include "proto/command_tree.hpp"
#include "proto/empty_element.hpp"
#include "proto/empty_value.hpp"
#include "proto/named_files.hpp"

int main(int argc, char** argv) {
    using namespace vibrig::tool;
    CLI::App app{"Vibrig: gyro error coefficients of an inertial platform on a vibration rig.",
                 "vibrig"};
    app.set_version_flag("--version", "vibrig " VIBRIG_VERSION);
    app.require_subcommand(1);
    app.footer(
        "Example: vibrig identify recording.csv --config rig.toml\n"
        "`vibrig COMMAND --help` explains a command.\n"
        "Exit codes: 0 done, 1 the result says no, 2 bad usage or input.");
    int exit_code = 0;
    for (const auto add :
         {add_identify,   add_uncertainty, add_allan,     add_plan,  add_predict, add_calibrate,
          add_level,      add_zero,        add_reproduce, add_study, add_replay,  add_recordings,
          add_reports,    add_certificate, add_list,      add_trend, add_archive, add_remote,
          add_commission, add_journal,     add_pki})
        add(app, exit_code);
    vibrig::proto::refuse_empty_values(app);
    vibrig::proto::keep_named_files(app);
    if (vibrig::proto::asks_for_command_tree(argc, argv)) {
        std::cout << vibrig::proto::command_tree_json(
            app, {{0, "done"}, {1, "the result says no"}, {kBadInput, "bad usage or input"}});
        return vibrig::proto::print_status(app);
    }
    // Of a word that it does not know CLI11 says only that there should be a command.
    const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
    const auto is_named = [&](const CLI::App* command) { return command->check_name(argv[1]); };
    if (argc > 1 && *argv[1] != '-' && std::ranges::none_of(commands, is_named)) {
        std::cerr << "vibrig: found \"" << argv[1]
                  << "\", expected a command; vibrig --help lists them\n";
        return kBadInput;
    }
    try {
        vibrig::proto::refuse_empty_elements(app, {argv + 1, argv + argc});
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        // CLI11 has codes of its own for each kind of bad usage; people and scripts get one.
        return app.exit(error) == 0 ? vibrig::proto::print_status(app) : kBadInput;
    } catch (const std::exception& error) {
        std::cerr << "vibrig: " << error.what() << '\n';
        return kBadInput;
    }
    return exit_code;
}
