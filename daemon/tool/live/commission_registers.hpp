#pragma once

#include <iosfwd>
#include <string>

namespace vibrig::tool {

struct RegisterOptions {
    std::string by, tcp, device, plate, configuration;
    int baud = 19200, unit = 1, holding = 128, input = 32;
    bool write = false, json = false;
};

/// What somebody types, without blanks around it. Throws std::runtime_error where nobody does.
std::string typed_line(std::ostream& out);

/// The registers that the configuration states, tried one by one. Exit code.
int try_registers(const RegisterOptions& options);

}  // namespace vibrig::tool
