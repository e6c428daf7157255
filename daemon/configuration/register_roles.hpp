#pragma once

#include <vector>

#include "drivers/shaker/shaker.hpp"

namespace vibrig::configuration {

struct RegisterRole {
    const char* name;  ///< of its table below shaker.registers
    const proto::Register* reg;
    bool written;   ///< by the daemon
    bool quantity;  ///< has a scale
};

/// Those that this controller has.
[[nodiscard]] std::vector<RegisterRole> roles_of(const proto::ShakerRegisters& registers);

}  // namespace vibrig::configuration
