#pragma once

// Of CLI11 whatever a command needs: App.hpp alone does not link.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <memory>
#include <vector>

#include "daemon/results/exit_status.hpp"
#include "proto/option_value.hpp"

namespace vibrig::tool {

/// Each adds one or several subcommands to `vibrig`. A callback that fails sets `exit_code` (1: the
/// result says no, 2: bad usage or input) and has printed why to standard error.
void add_identify(CLI::App& app, int& exit_code);
void add_uncertainty(CLI::App& app, int& exit_code);
void add_allan(CLI::App& app, int& exit_code);
void add_plan(CLI::App& app, int& exit_code);
void add_predict(CLI::App& app, int& exit_code);
void add_calibrate(CLI::App& app, int& exit_code);
void add_level(CLI::App& app, int& exit_code);
void add_zero(CLI::App& app, int& exit_code);
void add_reproduce(CLI::App& app, int& exit_code);
void add_study(CLI::App& app, int& exit_code);    ///< study plan, run, submit, status, merge
void add_journal(CLI::App& app, int& exit_code);  ///< journal verify
void add_pki(CLI::App& app, int& exit_code);
void add_remote(
    CLI::App& app,
    int& exit_code);  ///< status, selftest, watch, events, arm, start, pause, resume, abort, ack
void add_commission(CLI::App& app, int& exit_code);  ///< commission, its status and accept
void add_commission_bus(CLI::App& commissioning, int& exit_code);
void add_commission_registers(CLI::App& commissioning, int& exit_code);
void add_replay(CLI::App& app, int& exit_code);
void add_reports(CLI::App& app, int& exit_code);  ///< report, compensate
void add_list(CLI::App& app, int& exit_code);
void add_trend(CLI::App& app, int& exit_code);
void add_archive(CLI::App& app, int& exit_code);  ///< archive add, verify
void add_archive_serve(CLI::App& group, int& exit_code);
void add_archive_type(CLI::App& group, int& exit_code);
void add_certificate(CLI::App& app, int& exit_code);
void add_recordings(CLI::App& app, int& exit_code);  ///< export, recover

/// A command, and where its options are kept.
template <class Options>
struct Command {
    CLI::App& app;
    Options& options;
};

/// Adds to `group` a command whose body is guarded() once its options are read.
template <class Options>
[[nodiscard]] Command<Options> add_command(CLI::App& group, int& exit_code, const char* name,
                                           const char* help, int (*run)(const Options&),
                                           const char* who = "") {
    const auto options = std::make_shared<Options>();
    CLI::App& app = *group.add_subcommand(name, help);
    app.callback([options, run, who, &exit_code] {
        exit_code = guarded([&] { return run(*options); }, who);
    });
    return {app, *options};
}

using proto::kAboveZero;

/// An option that takes a number as proto::finite() has it; `Number`: double, or an optional one.
template <class Number>
CLI::Option* add_number(CLI::App& command, const char* name, Number& value, const char* help,
                        double low = proto::kAnyLow, double high = proto::kAnyHigh) {
    return command.add_option(name, value, help)->check(proto::finite(low, high));
}

/// So many of them with commas between; `count` 0: any number of them.
inline CLI::Option* add_numbers(CLI::App& command, const char* name, std::vector<double>& values,
                                int count, const char* help, double low = proto::kAnyLow,
                                double high = proto::kAnyHigh) {
    CLI::Option* const option = add_number(command, name, values, help, low, high)->delimiter(',');
    return count > 0 ? option->expected(count) : option;
}

}  // namespace vibrig::tool
