#include <array>

#include "daemon/domain/campaign_state.hpp"
#include "daemon/domain/events.hpp"
#include "proto/word_of.hpp"

namespace vibrig {

const char* name_of(CampaignState state) noexcept {
    static constexpr std::array kWords{"idle",    "armed",     "waiting",   "slewing",
                                       "ramping", "settling",  "recording", "resting",
                                       "paused",  "finished",  "aborted",   "tripped",
                                       "zeroing", "levelling", "checking",  "commissioning"};
    return proto::word_of(kWords, state, "unknown");
}

const char* name_of(Severity severity) noexcept {
    static constexpr std::array kWords{"info", "warning", "alarm", "trip"};
    return proto::word_of(kWords, severity, "unknown");
}

}  // namespace vibrig
