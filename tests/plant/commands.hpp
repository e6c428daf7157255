#pragma once

namespace CLI {
class App;
}

namespace vibrig::plant {

/// Each adds its subcommand; the callback sets `exit_code` (0 good, 1 the result says no, 2 bad
/// input).
void add_run_command(CLI::App& app, int& exit_code);
void add_record_command(CLI::App& app, int& exit_code);
void add_judge_command(CLI::App& app, int& exit_code);

}  // namespace vibrig::plant
