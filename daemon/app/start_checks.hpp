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
/// Throws ConfigurationError unless results can be kept where they are to be.
void check_results(const configuration::Configuration& configuration);
/// What the campaign's positions and levels would leave undetermined; empty if nothing.
[[nodiscard]] std::vector<std::string> check_plan(
    const configuration::Configuration& configuration);

}  // namespace vibrig
