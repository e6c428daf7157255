#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "proto/command_tree.hpp"
#include "proto/dbc.hpp"
#include "proto/empty_element.hpp"
#include "proto/empty_value.hpp"
#include "proto/named_files.hpp"
#include "proto/text.hpp"
#include "tests/plant/commands.hpp"

int main(int argc, char** argv) {
    CLI::App app{
        "The simulated vibration rig: platform, isolators and shaker, with a truth only it knows.",
        "vibrig-plant"};
    app.require_subcommand(1);
    app.footer(
        "Example:\n  vibrig-plant run --can seqpacket:/tmp/rig.sock --modbus tcp:127.0.0.1:1502 "
        "--seed 7");
    int exit_code = 0;
    vibrig::plant::add_run_command(app, exit_code);
    vibrig::plant::add_record_command(app, exit_code);
    vibrig::plant::add_judge_command(app, exit_code);
    app.set_version_flag("--version", "vibrig-plant " VIBRIG_VERSION);
    bool print_dbc = false;
    app.add_flag("--print-dbc", print_dbc, "print the built-in rig.dbc, and end");
    vibrig::proto::refuse_empty_values(app);
    vibrig::proto::keep_named_files(app);
    if (vibrig::proto::asks_for_command_tree(argc, argv)) {
        std::cout << vibrig::proto::command_tree_json(
            app, {{0, "done; judge: all coefficients within the limit"},
                  {1, "judge: not so"},
                  {2, "bad usage or input"}});
        return vibrig::proto::print_status(app);
    }
    if (argc == 2 && std::string_view(argv[1]) == "--print-dbc") {
        std::cout << vibrig::proto::rig_dbc_text();
        return vibrig::proto::print_status(app);
    }
    try {
        // "vibrig-plant --can ..." means run.
        std::vector<std::string> arguments(argv + 1, argv + argc);
        const std::string first = arguments.empty() ? "--help" : arguments.front();
        if (first.starts_with("-") && first != "-h" && first != "--help" && first != "--version")
            arguments.insert(arguments.begin(), "run");
        if (arguments.empty()) arguments.emplace_back("run");
        const std::string& word = arguments.front();
        const auto is_it = [&word](const CLI::App* command) { return command->check_name(word); };
        if (!word.starts_with("-") && std::ranges::none_of(app.get_subcommands({}), is_it))
            throw std::runtime_error("found \"" + vibrig::proto::printable(word) +
                                     "\", expected a command; vibrig-plant --help lists them");
        vibrig::proto::refuse_empty_elements(app, arguments);
        std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
        app.parse(arguments);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? vibrig::proto::print_status(app) : 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "vibrig-plant: %s\n", error.what());
        return 2;
    }
    const int printed = vibrig::proto::print_status(app);
    return printed != 0 ? printed : exit_code;
}
