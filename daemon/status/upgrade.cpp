#include "daemon/status/upgrade.hpp"

#include <cstdlib>
#include <string_view>

namespace vibrig {

std::string restart_request_file() {
    const char* const folders = std::getenv("RUNTIME_DIRECTORY");
    if (folders == nullptr || *folders == '\0') return {};
    const std::string all = folders;
    return all.substr(0, all.find(':')) + "/restart-when-at-rest";
}

std::string restart_waits_for(const StatusData& status) {
    if (status.state != CampaignState::idle && status.state != CampaignState::finished &&
        status.state != CampaignState::aborted)
        return std::string("the campaign is ") + name_of(status.state);
    if (!status.armed_by.empty()) return "armed by " + status.armed_by;
    if (!status.interlock.tripped.empty())
        return "a trip that nobody has acknowledged: " + status.interlock.tripped;
    // What cannot be read may move.
    if (!status.shaker.valid) return "no reading of the shaker";
    const std::string_view rest = status.rest.state;
    if (status.rest.disobeyed || rest == "moving" || rest == "stopping")
        return "the accelerometers: " + std::string(rest);
    if (status.stop_pending) return "a stop is not read back as done";
    if (status.shaker.running) return "the shaker runs";
    return {};
}

}  // namespace vibrig
