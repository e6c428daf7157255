#pragma once

#include <string>

namespace vibrig::configuration {

inline std::string profile_with(const std::string& lines) {
    return "[[profile]]\nname = \"p\"\n" + lines;
}

inline const std::string kRandomRegisters = R"([shaker.registers]
mode = { address = 8 }
profile_number = { address = 9 }
profile_level_db = { address = 10 }
profile_checksum = { address = 5 }
measured_g_rms = { address = 7 }
control_state = { address = 9 }
)";

inline const char* const kSweepRegisters =
    "shaker.registers.mode.address = 8\n"
    "shaker.registers.sweep_from = { address = 11, type = \"u32\", scale = 0.001 }\n"
    "shaker.registers.sweep_to = { address = 13, type = \"u32\", scale = 0.001 }\n"
    "shaker.registers.sweep_rate = { address = 15, scale = 0.01 }\n"
    "shaker.registers.actual_frequency = { address = 10, table = \"input\", type = \"u32\", "
    "scale = 0.001 }\n";

}  // namespace vibrig::configuration
