// Before anything shakes a campaign holds its configuration against the rig at rest. The record is
// right, as it were: somebody has forged it, or the rig has been rewired since.
#include <functional>

#include "tests/unit/daemon/campaign/opening_fixture.hpp"

namespace vibrig::campaign {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(OpeningTest, ARightConfigurationGoesOn) {
    open_with([](estimator::Settings&) {});
    run_check();
    EXPECT_EQ(status().state, CampaignState::slewing) << status().reason;
    EXPECT_THAT(events, Contains("opening check: the rig is what its configuration says"));
    EXPECT_THAT(events, Not(Contains(HasSubstr("warned above"))));
    EXPECT_TRUE(run_until(CampaignState::ramping, 60));
    EXPECT_FALSE(slewed_while_moving);
    EXPECT_THAT(campaign->arming_text({Kind::arm, "Ada", ""}), HasSubstr("about 7 min"));
}

struct WrongConfiguration {
    const char* name;
    std::function<void(estimator::Settings&)> change;
    const char* key;
};

struct WrongOpening : OpeningTest, ::testing::WithParamInterface<WrongConfiguration> {};

TEST_P(WrongOpening, IsAbortedBeforeTheTableMovesAndTheKeyIsNamed) {
    open_with(GetParam().change);
    run_check();
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_THAT(status().reason, HasSubstr("opening check: "));
    const auto suspects = status().reason.find("suspects: ");
    ASSERT_NE(suspects, std::string::npos) << status().reason;
    EXPECT_THAT(status().reason.substr(suspects), HasSubstr(GetParam().key));
    EXPECT_EQ(highest_asked(), 0);
    run_for(1);
    EXPECT_EQ(port.frames.back().data[6] & 0x0f, 0) << "released";
}

INSTANTIATE_TEST_SUITE_P(
    Keys, WrongOpening,
    ::testing::Values(
        WrongConfiguration{"InnerSign", [](auto& s) { s.encoder_sign[1] = -1; },
                           "platform.encoder_sign: 1 instead of -1 of the inner"},
        WrongConfiguration{"OuterZero", [](auto& s) { s.encoder_zero_deg[0] = 5; },
                           "instead of 5 of the outer gimbal"},
        WrongConfiguration{"InnerZero", [](auto& s) { s.encoder_zero_deg[1] = 5; },
                           "instead of 5 of the inner gimbal"},
        WrongConfiguration{"AzimuthZero", [](auto& s) { s.encoder_zero_deg[2] = 5; },
                           "instead of 5 of the azimuth gimbal"},
        WrongConfiguration{"Swapped",
                           [](auto& s) {
                               s.accelerometer_matrix = {{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}};
                           },
                           "accelerometer.matrix: x, y, z are +y, +x, +z"},
        WrongConfiguration{"Inverted",
                           [](auto& s) {
                               s.accelerometer_matrix = {{{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
                           },
                           "accelerometer.matrix: x, y, z are -x, -y, -z"},
        WrongConfiguration{"LatitudeSign", [](auto& s) { s.latitude_deg = -s.latitude_deg; },
                           "site.latitude_deg: 45.75 instead of -45.75"},
        WrongConfiguration{"Azimuth90", [](auto& s) { s.azimuth_deg = 90; }, "site.azimuth_deg: "}),
    [](const auto& wrong) { return std::string(wrong.param.name); });

TEST_F(OpeningTest, AnAbortMeanwhileReleasesAndTheNextCampaignBeginsItAnew) {
    open_with([](estimator::Settings&) {});
    EXPECT_TRUE(command(Kind::arm).accepted);
    EXPECT_TRUE(command(Kind::start).accepted);
    run_for(60);
    EXPECT_THAT(status().reason, HasSubstr("opening check, position 2 of 5"));
    EXPECT_TRUE(command(Kind::abort).accepted);
    run_for(1);
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_EQ(port.frames.back().data[6] & 0x0f, 0);
    events.clear();
    run_check();
    EXPECT_EQ(status().state, CampaignState::slewing) << status().reason;
    EXPECT_THAT(events, Contains("opening check: the rig is what its configuration says"));
}

TEST_F(OpeningTest, WithoutStillSecondsItEnds) {
    open_with([](estimator::Settings&) {});
    second = [] { return rt::MeanMotion{}; };
    make();
    run_check();
    EXPECT_EQ(status().state, CampaignState::aborted);
    EXPECT_THAT(status().reason, HasSubstr("no still seconds"));
}

TEST_F(OpeningTest, AShakerThatLeavesRestEndsIt) {
    open_with([](estimator::Settings&) {});
    EXPECT_TRUE(command(Kind::arm).accepted);
    EXPECT_TRUE(command(Kind::start).accepted);
    run_for(20);
    shaker_obeys = false;
    shaker.now.state = 2;
    shaker.now.running = true;
    run_for(1);
    EXPECT_THAT(status().state, AnyOf(CampaignState::aborted, CampaignState::tripped));
}

}  // namespace
}  // namespace vibrig::campaign
