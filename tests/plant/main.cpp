#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

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
    try {
        // "vibrig-plant --can ..." means run.
        std::vector<std::string> arguments(argv + 1, argv + argc);
        const std::string first = arguments.empty() ? "--help" : arguments.front();
        if (first.starts_with("-") && first != "-h" && first != "--help")
            arguments.insert(arguments.begin(), "run");
        if (arguments.empty()) arguments.emplace_back("run");
        std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
        app.parse(arguments);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "vibrig-plant: %s\n", error.what());
        return 2;
    }
    return exit_code;
}
