#pragma once

#include <string>
#include <string_view>

#include "tests/plant/shared_rig.hpp"

namespace vibrig::plant {

/// Lines by which a person or a test works the rig while it runs:
///   fault SPEC | clear [NAME] | estop open | estop close | table G | table own | hold S |
///   go | speed F | speed max |
///   status | help
class Control {
  public:
    explicit Control(SharedRig& rig) : rig_(rig) {}

    /// One line of answer: "ok ..." or "error: ...". Never throws for a bad line.
    [[nodiscard]] std::string execute(std::string_view line);
    /// Reads what the descriptor has, executes whole lines, prints the answers. False at end of
    /// file.
    bool read(int descriptor);

  private:
    SharedRig& rig_;
    std::string pending_;
};

/// The lines, for those who ask.
inline constexpr const char* kControlLines =
    "fault SPEC, clear [NAME], estop open, estop close, table G, table own, hold S, go, speed F, "
    "speed max, status, help";

/// How many times real time; 0: "max", no limit. Throws PlantError that names the place.
[[nodiscard]] double speed_of(std::string_view text, const char* place);

}  // namespace vibrig::plant
