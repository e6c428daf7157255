#pragma once

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/serve/client.hpp"
#include "daemon/tool/live/toml_edit.hpp"

/// What the commands of `vibrig commission` share.
namespace vibrig::tool {

using CommissionJson = nlohmann::ordered_json;

/// The daemon says no: an answer, no bad input.
class CommissionRefused : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Throws CommissionRefused when the daemon says no, ClientError when it cannot be asked.
std::string commission_command(serve::Client& client, const std::string& by,
                               const CommissionJson& what);
CommissionJson commission_state(serve::Client& client, const std::string& by, std::size_t after);

/// At blanks, to fit into 80 columns; what follows is indented.
void print_wrapped(std::ostream& out, const std::string& line);

struct CommissionOptions {
    serve::Address at;
    std::string by, second, answers, configuration, ask, identity;
    std::string display;     ///< unit that the controller's display shows
    double reference_g = 0;  ///< by a reference on the table
    std::vector<std::string> parts;
    bool json = false, by_hand = false, yes = false, resume = false, bus = false;
};

/// Proves the shaker's parts by proofs of the safe state, one for each button. Exit code.
int commission_shaker(const CommissionOptions& options);

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
