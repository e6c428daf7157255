#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "drivers/shaker/shaker.hpp"

namespace vibrig::configuration {

struct RegisterTypeRow {
    const char* word;
    double largest;  ///< count
};

/// By proto::RegisterType.
inline constexpr std::array<RegisterTypeRow, 6> kRegisterTypes{
    {{"u16", 65'535},
     {"i16", 32'767},
     {"u32", 4'294'967'295.0},
     {"i32", 2'147'483'647.0},
     {"f32", std::numeric_limits<float>::max()},
     {"bits", 1}}};
static_assert([] {
    using enum proto::RegisterType;
    constexpr std::array kInOrder{u16, i16, u32, i32, f32, bits};
    for (std::size_t i = 0; i < kInOrder.size(); ++i)
        if (static_cast<std::size_t>(kInOrder[i]) != i) return false;
    return kInOrder.size() == kRegisterTypes.size();
}());
[[nodiscard]] inline const RegisterTypeRow& row_of(proto::RegisterType type) {
    return kRegisterTypes[static_cast<std::size_t>(type)];
}

struct RegisterRole {
    const char* name;  ///< of its table below shaker.registers
    const proto::Register* reg;
    bool written;   ///< by the daemon
    bool quantity;  ///< has a scale
};

/// Those that this controller has.
[[nodiscard]] std::vector<RegisterRole> roles_of(const proto::ShakerRegisters& registers);

}  // namespace vibrig::configuration
