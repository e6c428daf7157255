#include "daemon/domain/campaign_state.hpp"
#include "daemon/domain/events.hpp"

namespace vibrig {

const char* name_of(CampaignState state) noexcept {
    switch (state) {
        case CampaignState::idle:
            return "idle";
        case CampaignState::armed:
            return "armed";
        case CampaignState::waiting:
            return "waiting";
        case CampaignState::slewing:
            return "slewing";
        case CampaignState::ramping:
            return "ramping";
        case CampaignState::settling:
            return "settling";
        case CampaignState::recording:
            return "recording";
        case CampaignState::resting:
            return "resting";
        case CampaignState::paused:
            return "paused";
        case CampaignState::finished:
            return "finished";
        case CampaignState::aborted:
            return "aborted";
        case CampaignState::tripped:
            return "tripped";
        case CampaignState::zeroing:
            return "zeroing";
        case CampaignState::levelling:
            return "levelling";
        case CampaignState::checking:
            return "checking";
        case CampaignState::commissioning:
            return "commissioning";
    }
    return "unknown";
}

const char* name_of(Severity severity) noexcept {
    switch (severity) {
        case Severity::info:
            return "info";
        case Severity::warning:
            return "warning";
        case Severity::alarm:
            return "alarm";
        case Severity::trip:
            return "trip";
    }
    return "unknown";
}

}  // namespace vibrig
