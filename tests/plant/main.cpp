#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "tests/plant/commands.hpp"

int main(int argc, char** argv) {
    CLI::App app{
        "The simulated vibration rig: platform, isolators and shaker, with a truth only it knows.",
        "vibrig-plant"};
    app.require_subcommand(1);
    int exit_code = 0;
    vibrig::plant::add_record_command(app, exit_code);
    vibrig::plant::add_judge_command(app, exit_code);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "vibrig-plant: %s\n", error.what());
        return 2;
    }
    return exit_code;
}
