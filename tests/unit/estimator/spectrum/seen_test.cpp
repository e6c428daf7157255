#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "estimator/identification/dwell_row.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/profile.hpp"
#include "estimator/spectrum/seen.hpp"
#include "tests/unit/estimator/spectrum/from_samples.hpp"

// What accelerometers see of a vibration: bandwidth, order, table and skew, against the numbers of
// first-order accelerometers that docs/theory/spectrum.md has, and against the simulated rig's.
namespace vibrig::estimator::spectrum {
namespace {

AccelerometerResponse low_pass(double hz, int order = 1) {
    AccelerometerResponse of;
    of.bandwidth_hz = hz;
    of.order = order;
    return of;
}

TEST(AccelerometerResponse, SeesOfASineWhatItsOrderLetsThrough) {
    const auto narrow = low_pass(100), wide = low_pass(500);
    EXPECT_NEAR(narrow.power(15), 0.978, 5e-4);
    EXPECT_NEAR(narrow.power(60), 0.735, 5e-4);
    EXPECT_NEAR(narrow.power(200), 0.200, 5e-4);
    EXPECT_NEAR(wide.power(15), 0.999, 5e-4);
    EXPECT_NEAR(wide.power(60), 0.986, 5e-4);
    EXPECT_NEAR(wide.power(200), 0.862, 5e-4);
    for (const int order : {1, 2, 5}) EXPECT_NEAR(low_pass(80, order).power(80), 0.5, 1e-12);
    EXPECT_NEAR(low_pass(100, 2).power(60), 1 / (1 + std::pow(0.6, 4)), 1e-12);
    EXPECT_EQ(AccelerometerResponse{}.power(1e4), 1);
}

TEST(AccelerometerResponse, SeesOfAProfileItsShare) {
    const Profile flat{"", {{20, 0.02}, {200, 0.02}}, {}, {0, 1, 0}, 0};
    const Profile integrity{"", {{20, 0.04}, {1000, 0.04}, {2000, 0.01}}, {}, {0, 1, 0}, 0};
    const auto share = [](double hz, const Profile& of) {
        return seen_of(low_pass(hz), bands_of(of)).share;
    };
    EXPECT_NEAR(share(100, flat), 0.505, 1e-3);
    EXPECT_NEAR(share(500, flat), 0.946, 1e-3);
    EXPECT_NEAR(share(100, integrity), 0.088, 1e-3);
    EXPECT_NEAR(share(500, integrity), 0.403, 1e-3);
}

TEST(AccelerometerResponse, ATableIsStraightOnLogarithmicScalesAndReachesNoFurther) {
    AccelerometerResponse of;
    of.table = {{10, 1}, {40, 0.81}, {160, 0.4}};
    EXPECT_EQ(of.power(5), 1);
    EXPECT_NEAR(of.power(20), 0.81, 1e-12);  // sqrt(0.81)^2
    EXPECT_NEAR(of.power(40), 0.6561, 1e-12);
    EXPECT_NEAR(of.power(80), 0.81 * 0.4, 1e-12);
    EXPECT_EQ(of.power(161), 0);
}

TEST(AccelerometerResponse, SkewIsAnUncertaintyOfTheSecondMoment) {
    AccelerometerResponse of;
    of.skew_ms = 1;
    EXPECT_NEAR(of.skew_error(60), 0.0355, 1e-4);
    of.skew_ms = 0.1;
    EXPECT_NEAR(of.skew_error(60), 3.55e-4, 1e-5);
    const std::vector<Band> two{{60, 0.25, 0}, {120, 0.75, 0}};
    EXPECT_NEAR(seen_of(of, two).error, (0.25 + 0.75 * 4) * 3.553e-4, 1e-6);
}

plant::Truth quiet_rig() {
    plant::Truth truth;
    truth.hard = true;
    truth.resolver_arcsec = truth.accelerometer_g = truth.gyro_random_walk_deg_per_rt_h = 0;
    return truth;
}

/// 18 g^2 at 15.1, 45.1 and 65.1 Hz: what is declared is taken out, what is not makes it small.
TEST(AccelerometerResponse, OfTheSimulatedRigIsTakenOutOfTheRows) {
    for (const int order : {1, 2}) {
        plant::Truth truth = quiet_rig();
        truth.accelerometer_bandwidth_hz = 100;
        truth.accelerometer_order = order;
        plant::CampaignPlan plan;
        plan.positions_deg = {{45, 0, 60}};
        plan.frequency_hz = {15.1, 45.1, 65.1};
        plan.table_g.assign(3, 6);
        plan.dwell_s = 30;
        Settings settings;
        settings.accelerometer_response = low_pass(100, order);
        const auto declared = testing::rows_through(truth, plan, settings);
        const auto blind = testing::rows_through(truth, plan, {});
        ASSERT_EQ(declared.size(), 3U);
        for (std::size_t i = 0; i < 3; ++i) {
            const double hz = plan.frequency_hz[i], power = low_pass(100, order).power(hz);
            // The rig's filter takes the motion as straight over 1/8 ms: (w T)^2/6 of the power.
            EXPECT_NEAR(declared[i].vibration.kappa - 1, 18, 18 * 1e-3) << hz << ", " << order;
            EXPECT_NEAR(blind[i].vibration.kappa - 1, 18 * power, 18 * 1e-3) << hz;
        }
    }
}

TEST(AccelerometerResponse, OfTheSimulatedRigIsTakenOutOfRandomVibration) {
    plant::Truth truth = quiet_rig();
    truth.profiles = {{3, {{20, 0.02}, {200, 0.02}}}};
    truth.accelerometer_bandwidth_hz = 120;
    plant::CampaignPlan plan;
    plan.positions_deg = {{45, 0, 60}};
    plan.profile = {3};
    plan.frequency_hz = {15};
    plan.table_g = {std::sqrt(3.6)};
    plan.dwell_s = 100;
    Settings settings;
    settings.accelerometer_response = low_pass(120);
    const auto bands = bands_of({"", {{20, 0.02}, {200, 0.02}}, {}, {0, 1, 0}, 0});
    settings.seen_profiles = {{3, seen_of(settings.accelerometer_response, bands)}};
    const auto rows = testing::rows_through(truth, plan, settings);
    ASSERT_EQ(rows.size(), 1U);
    // 4 sigma of profile and samples together.
    EXPECT_NEAR(rows[0].vibration.kappa - 1, 3.6, 3.6 * 4 * rows[0].relative_error);
    EXPECT_LT(rows[0].relative_error, 0.012);
}

/// Not declared, samples and profile are 40 % apart, 2.2 % of which is chance.
TEST(AccelerometerResponse, ThatIsNotDeclaredIsNotTakenForTheProfilesLevel) {
    DwellInfo info;
    info.random = {3.6, 180, 0.01, 200, 3};
    Settings settings;
    const auto reason = [&] {
        Identification one(settings, 1);
        one.begin_dwell(info);
        std::mt19937_64 draw(5);
        std::normal_distribution<double> normal;
        for (int i = 0; i < 4000; ++i) {
            const double g = 1 + std::sqrt(0.6 * 3.6) * normal(draw);
            static_cast<void>(one.add({0.025 * i, {}, {0, g, 0}}));
        }
        return std::string(one.end_dwell().reason);
    };
    EXPECT_NE(reason().find("disagree on the level"), std::string::npos);
    settings.seen_profiles = {{3, {0.6, 0}}};
    EXPECT_EQ(reason().find("disagree on the level"), std::string::npos);
}

/// Of three axes read one after the other, the vertical at 45 deg between the first and the last.
TEST(AccelerometerResponse, SkewOfTheSimulatedRigMakesTheMomentSmallByWhatIsDeclared) {
    plant::Truth truth = quiet_rig();
    truth.accelerometer_skew_ms = 2;  // 1 ms from each to the next
    plant::CampaignPlan plan;
    plan.positions_deg = {{0, 0, 45}};
    plan.frequency_hz = {65.1};
    plan.table_g = {6};
    plan.dwell_s = 30;
    Settings settings;
    settings.accelerometer_response.skew_ms = 1;
    const auto rows = testing::rows_through(truth, plan, settings);
    ASSERT_EQ(rows.size(), 1U);
    const double error = std::pow(std::numbers::pi * 65.1 * 1e-3, 2);
    EXPECT_NEAR(rows[0].relative_error, error, 1e-9);
    EXPECT_NEAR((rows[0].vibration.kappa - 1) / 18, 1 - error, 1e-3);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
