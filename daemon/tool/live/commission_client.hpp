#pragma once

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/serve/client.hpp"

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

struct ShakerCommission {
    serve::Address at;
    std::string by;
    std::vector<std::string> parts;  ///< of watchdog, stop, units, excitation
    std::string display;             ///< unit that the controller's display shows
    double reference_g = 0;          ///< by a reference on the table
    bool json = false, yes = false;
};
/// Proves the shaker's parts by proofs of the safe state, one for each button. Exit code.
int commission_shaker(const ShakerCommission& options);

}  // namespace vibrig::tool
