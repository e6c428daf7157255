#pragma once

#include <string>
#include <vector>

#include "daemon/tool/live/commission_client.hpp"
#include "daemon/tool/live/toml_edit.hpp"

/// What `vibrig commission` writes: the configuration, and the record by way of the daemon.
namespace vibrig::tool {

struct CommissionOptions {
    serve::Address at;
    std::string by, second, answers, configuration, ask, display, identity;
    double reference_g = 0;
    std::vector<std::string> parts;
    bool json = false, by_hand = false, yes = false, resume = false, bus = false;
};

/// Keys that were found, with their evidence behind `mark`.
std::vector<TomlValue> values_of(const CommissionJson& found, const CommissionJson& by,
                                 const std::string& mark);
std::string mark_of(const CommissionJson& of);

/// Writes what was found into the configuration, and has it recorded by two persons. Exit code.
int accept_commission(const CommissionOptions& options);
/// What `vibrig commission bus --find` found, into a configuration file, by two persons and without
/// a daemon: nothing is recorded. Exit code.
int accept_bus(const CommissionOptions& options);
/// What nothing measures, by two persons. Exit code.
int state_gyros(const CommissionOptions& options);

}  // namespace vibrig::tool
