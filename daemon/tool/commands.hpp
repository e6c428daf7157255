#pragma once

#include <CLI/App.hpp>

#include "daemon/results/exit_status.hpp"

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
void add_archive(CLI::App& app, int& exit_code);  ///< archive add, verify, serve
void add_certificate(CLI::App& app, int& exit_code);
void add_recordings(CLI::App& app, int& exit_code);  ///< export, recover

}  // namespace vibrig::tool
