#pragma once

#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "proto/dbc.hpp"

namespace vibrig {

/// The configured DBC, the shipped one where none is. Throws DbcError.
[[nodiscard]] proto::Dbc load_dbc(const std::string& path);
/// Throws DbcError, or ConfigurationError that names each message that cannot be bound; opens
/// nothing.
void check_bindings(const configuration::Loaded& loaded);
/// Throws ConfigurationError unless results can be kept where they are to be: a folder is made
/// there and taken away, since permissions alone do not tell (root, /proc, a full disk).
void check_results(const configuration::Loaded& loaded);
/// Throws ConfigurationError unless this machine has what the start opens beside bus and shaker:
/// the files of `server.remote`, which have to fit together, and of the broker, the folders of log
/// and journal. What only the daemon's own user may read is left to its start.
void check_named(const configuration::Loaded& loaded);
/// Why the start on this machine would be refused for the operators' group; empty: it would not.
/// The package makes the group, so that a file checked on a desk may name one that is not there.
[[nodiscard]] std::string missing_group(const configuration::Loaded& loaded);
/// Of a real rig: statuses that the DBC does not have come as often as they have to, unchanged,
/// too.
[[nodiscard]] std::vector<std::string> slow_statuses(const configuration::Loaded& loaded);
/// What the campaign's positions and levels would leave undetermined; empty if nothing.
[[nodiscard]] std::vector<std::string> check_plan(
    const configuration::Configuration& configuration);

}  // namespace vibrig
