#pragma once

#include <string>

namespace vibrig::tool {

/// In the first line of every file that is made of a simulated rig's campaign.
inline constexpr const char* kSimulatedRig =
    "SIMULATED: the rig was a program, nothing in here was measured";

/// It with its line's end, or nothing.
[[nodiscard]] inline std::string simulated_line(bool simulated) {
    return simulated ? std::string(kSimulatedRig) + "\n" : "";
}

}  // namespace vibrig::tool
