#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "daemon/campaign/ports.hpp"

namespace vibrig::campaign {

/// What comes of a stage's step.
struct StageStep {
    enum class Kind : std::uint8_t {
        going_on,
        asks,  ///< before it goes on the campaign has its part to do, which the stage names
        done,
        failed
    } kind = Kind::going_on;
    drivers::Time next = 0;  ///< going on: when to be called next at the latest
    std::string why;         ///< failed

    static StageStep going_on(drivers::Time next) { return {Kind::going_on, next, {}}; }
    static StageStep asks() { return {Kind::asks, 0, {}}; }
    static StageStep done() { return {Kind::done, 0, {}}; }
    static StageStep failed(std::string why) { return {Kind::failed, 0, std::move(why)}; }
};

/// A part of the campaign. It is begun, stepped until it is done or has failed, and left in every
/// case but after `done`. The campaign sees to it that the shaker rests where it has to, and
/// decides what follows. Control thread only; no call waits.
class Stage {
  public:
    Stage() = default;
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;
    virtual ~Stage() = default;

    virtual void begin(drivers::Time now) = 0;
    [[nodiscard]] virtual StageStep step(drivers::Time now) = 0;
    virtual void leave() = 0;
    /// Where the table is to be meanwhile, or is on its way to, peak.
    [[nodiscard]] virtual double table_g() const { return 0; }
};

/// How often a stage looks when nothing calls it earlier.
inline constexpr drivers::Time kStagePoll = 200 * drivers::kMillisecond;
/// Blocks and increments come ten and a hundred times a second.
inline constexpr drivers::Time kSilence = drivers::kSecond;

/// Why the platform is not fit to be measured; empty: it is.
[[nodiscard]] std::string platform_lacks(const drivers::PlatformStatus& platform,
                                         drivers::Time now);
/// A status older than that is no status.
[[nodiscard]] bool platform_is_silent(const drivers::PlatformStatus& platform, drivers::Time now);
/// By what the platform itself reports.
[[nodiscard]] bool torquing(const Rig& rig);
/// Nothing is fed any more, and nothing is torqued.
void let_go(Rig& rig);

}  // namespace vibrig::campaign
