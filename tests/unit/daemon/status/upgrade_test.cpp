#include <gtest/gtest.h>

#include <cstdlib>

#include "daemon/status/upgrade.hpp"

namespace vibrig {
namespace {

StatusData at_rest() {
    StatusData status;
    status.shaker.valid = true;
    return status;
}

TEST(Upgrade, RestartsAtRestAndDisarmedOnly) {
    for (int i = 0; i <= static_cast<int>(kLastCampaignState); ++i) {
        StatusData status = at_rest();
        status.state = static_cast<CampaignState>(i);
        const bool rests = status.state == CampaignState::idle ||
                           status.state == CampaignState::finished ||
                           status.state == CampaignState::aborted;
        const std::string why = restart_waits_for(status);
        EXPECT_EQ(why.empty(), rests) << name_of(status.state);
        if (!rests) {
            EXPECT_NE(why.find(name_of(status.state)), std::string::npos) << why;
        }
    }
}

TEST(Upgrade, WaitsForEverythingThatMayMove) {
    EXPECT_EQ(restart_waits_for(at_rest()), "");
    StatusData armed = at_rest();
    armed.armed_by = "Ada";
    EXPECT_EQ(restart_waits_for(armed), "armed by Ada");
    StatusData pending = at_rest();
    pending.stop_pending = true;
    EXPECT_NE(restart_waits_for(pending), "");
    StatusData running = at_rest();
    running.shaker.running = true;
    EXPECT_NE(restart_waits_for(running), "");
    StatusData moving = at_rest();
    moving.rest.state = "moving";
    EXPECT_NE(restart_waits_for(moving), "") << "whatever the controller says";
    StatusData blind = at_rest();
    blind.shaker.valid = false;
    EXPECT_NE(restart_waits_for(blind), "") << "what cannot be read may move";
    StatusData tripped = at_rest();
    tripped.interlock.tripped = "emergency_stop";
    EXPECT_NE(restart_waits_for(tripped).find("emergency_stop"), std::string::npos);
}

TEST(Upgrade, IsAskedForInTheFolderOfTheService) {
    ::unsetenv("RUNTIME_DIRECTORY");
    EXPECT_EQ(restart_request_file(), "");
    ::setenv("RUNTIME_DIRECTORY", "/run/vibrig:/run/other", 1);
    EXPECT_EQ(restart_request_file(), "/run/vibrig/restart-when-at-rest");
    ::unsetenv("RUNTIME_DIRECTORY");
}

}  // namespace
}  // namespace vibrig
