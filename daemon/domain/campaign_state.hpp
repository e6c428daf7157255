#pragma once

#include <cstdint>

namespace vibrig {

enum class CampaignState : std::uint8_t {
    idle,     ///< measuring; shaker disarmed
    armed,    ///< a named person armed it; nothing moves
    waiting,  ///< for platform ready and steady temperature
    slewing,
    ramping,
    settling,
    recording,
    resting,  ///< ramping down, waiting for rest
    paused,   ///< at rest between positions, by command
    finished,
    aborted,
    tripped,        ///< stopped by an interlock; latched until acknowledged
    zeroing,        ///< azimuth slews at rest, for the accelerometers' zeros
    levelling,      ///< at rest in position
    checking,       ///< the loop, at a small level
    commissioning,  ///< gimbals move by a person's permission, the shaker rests
};
inline constexpr CampaignState kLastCampaignState = CampaignState::commissioning;
[[nodiscard]] const char* name_of(CampaignState state) noexcept;

}  // namespace vibrig
