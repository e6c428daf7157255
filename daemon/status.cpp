#include "daemon/status.hpp"

#include <algorithm>
#include <cmath>

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

double InterlockStatus::Row::margin() const noexcept {
    if (!has_limit || !std::isfinite(present)) return std::numeric_limits<double>::quiet_NaN();
    // What has to stay below zero, or above it, has no scale of its own.
    const double left = below ? (present > 0        ? 1 - limit / present
                                 : present >= limit ? 1.0
                                                    : 0.0)
                              : (limit > 0          ? 1 - present / limit
                                 : present <= limit ? 1.0
                                                    : 0.0);
    return std::clamp(left, 0.0, 1.0);
}

}  // namespace vibrig
