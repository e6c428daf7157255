#pragma once

#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {

/// A sine at 9 g, then a profile at 2 g rms.
struct RandomDwellTest : CampaignTest {
    RandomDwellTest() {
        settings.table_g = {9};
        settings.stops = {{{0, 0, 0}, 9}, {{0, 0, 90}, 2, 0, false, 0.5}};
        settings.stops[1].random =
            RandomStop{{4, -3, 0x89abcdef}, {1, 100, 0.01, 500, 4, -3}, 1, "broad"};
        make();
    }
    CommandReply begin() {
        static_cast<void>(command(Kind::arm));
        return command(Kind::start);
    }
};

}  // namespace vibrig::campaign
