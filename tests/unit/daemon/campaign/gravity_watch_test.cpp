#include "daemon/campaign/gravity_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>

namespace vibrig::campaign {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

/// A second at these encoder angles on the rig as it is in truth.
rt::MeanMotion second_at(const estimator::Settings& truth, const Vector& encoder_deg) {
    rt::MeanMotion mean;
    mean.good = true;
    for (std::size_t i = 0; i < 3; ++i) mean.angle[i] = encoder_deg[i] * kRadiansPerDegree;
    const RigFrame frame(truth);
    mean.force = frame.to_raw(frame.up_at_deg(encoder_deg));
    for (std::size_t i = 0; i < 3; ++i) mean.force[i] += truth.accelerometer_zero_g[i];
    return mean;
}

TEST(GravityWatch, ARightRigWithTheErrorsOfACommissionedOneIsLetWhereverItStands) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937 random(seed);
        const auto between = [&random](double low, double high) {
            return std::uniform_real_distribution(low, high)(random);
        };
        estimator::Settings rig;
        for (double& zero : rig.encoder_zero_deg) zero = between(-180, 180);
        rig.encoder_sign = {1, -1, 1};
        GravityWatch watch(rig, {});
        for (int n = 0; n < 50; ++n) {
            auto second =
                second_at(rig, {between(-180, 180), between(-180, 180), between(-180, 180)});
            // 1 mg of forecast, resolvers within 0.03 deg
            for (double& force : second.force) force += between(-1e-3, 1e-3);
            for (double& angle : second.angle) angle += between(-0.03, 0.03) * kRadiansPerDegree;
            watch.next_position();
            const auto verdict = watch.judge(second, rig.accelerometer_zero_g, true);
            EXPECT_FALSE(verdict.warned) << watch.words();
        }
    }
}

TEST(GravityWatch, TheVibrationIsAlongTheVerticalOfTheEncodersUpToAQuarterAcrossIt) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937 random(seed);
        const auto between = [&random](double low, double high) {
            return std::uniform_real_distribution(low, high)(random);
        };
        const estimator::Settings rig;
        const RigFrame frame(rig);
        GravityWatch watch(rig, {});
        for (const double share : {0.0, 0.1, 0.25, 0.3, 1.0}) {
            // GIVEN 5 g of any phase, and so much of it across, a quarter of a period apart or not
            const Vector at{between(-180, 180), between(-180, 180), between(-180, 180)};
            auto second = second_at(rig, at);
            const Vector up = frame.up_at_deg(at);
            Vector across = cross(up, Vector{0.3, -0.5, 0.8});
            const double size = std::sqrt(dot(across, across));
            const double phase = between(0, 6), lead = phase + between(0, 6);
            for (std::size_t i = 0; i < 3; ++i) {
                across[i] *= share / size;
                second.cosine[i] = 5 * (up[i] * std::cos(phase) + across[i] * std::cos(lead));
                second.sine[i] = 5 * (up[i] * std::sin(phase) + across[i] * std::sin(lead));
            }
            second.cosine = frame.to_raw(second.cosine);
            second.sine = frame.to_raw(second.sine);
            const auto verdict = watch.judge(second, rig.accelerometer_zero_g, false);
            EXPECT_NEAR(verdict.vibration_deg, std::atan(share) / kRadiansPerDegree, 1e-6);
            EXPECT_NEAR(verdict.vibration_g, 5 * std::hypot(1, share), 1e-9);
            EXPECT_EQ(verdict.vibration_off, share > 0.27) << watch.vibration_words();
            EXPECT_FALSE(verdict.warned) << "gravity is where it should be";
        }
        // what is too small to have a direction has none
        auto second = second_at(rig, {0, 0, 0});
        second.cosine = {0.2, 0, 0};
        EXPECT_FALSE(watch.judge(second, rig.accelerometer_zero_g, false).vibration_off);
    }
}

TEST(GravityWatch, NamesTheKeyThatIsWrong) {
    struct Case {
        const char* suspect;
        std::function<void(estimator::Settings&)> spoil;
    };
    for (const Case& one :
         {Case{"encoder_sign of the outer", [](auto& s) { s.encoder_sign[0] = -1; }},
          Case{"encoder_sign of the inner", [](auto& s) { s.encoder_sign[1] = -1; }},
          Case{"encoder_sign of the azimuth", [](auto& s) { s.encoder_sign[2] = -1; }},
          Case{"encoder_zero_deg of the outer gimbal, 0.00 instead of 5",
               [](auto& s) { s.encoder_zero_deg[0] = 5; }},
          Case{"encoder_zero_deg of the inner gimbal, 0.00 instead of 5",
               [](auto& s) { s.encoder_zero_deg[1] = 5; }},
          Case{"encoder_zero_deg of the azimuth gimbal, 0.00 instead of 5",
               [](auto& s) { s.encoder_zero_deg[2] = 5; }},
          Case{"accelerometers x, y, z are +y, +x, +z",
               [](auto& s) {
                   s.accelerometer_matrix = {{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}};
               }},
          Case{"accelerometers x, y, z are +x, +y, -z",
               [](auto& s) {
                   s.accelerometer_matrix = {{{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}};
               }},
          Case{"platform.up", [](auto& s) {
                   s.up = {2, 1};
               }}}) {
        const estimator::Settings truth;
        auto believed = truth;
        one.spoil(believed);
        GravityWatch watch(believed, {});
        bool refused = false;
        for (const Vector& deg : {Vector{60, 15, 90}, {0, 0, 0}, {-100, 20, 30}, {80, -25, -130}}) {
            watch.next_position();
            refused =
                watch.judge(second_at(truth, deg), truth.accelerometer_zero_g, true).refused ||
                refused;
        }
        EXPECT_TRUE(refused) << one.suspect;
        EXPECT_NE(watch.suspects().find(one.suspect), std::string::npos)
            << one.suspect << ", found: " << watch.suspects();
    }
}

TEST(GravityWatch, OfASizeThatIsWrongOnlyWhatChangesSizesIsSuspected) {
    estimator::Settings truth;
    const auto believed = truth;
    truth.accelerometer_zero_g = {0, 0.05, 0};
    GravityWatch watch(believed, {});
    // along the zero that is wrong there is no angle to be seen
    const auto verdict = watch.judge(second_at(truth, {0, 0, 0}), {}, true);
    EXPECT_TRUE(verdict.refused);
    EXPECT_NEAR(verdict.angle_deg, 0, 1e-9);
    EXPECT_NE(watch.suspects().find("accelerometer.zero_g"), std::string::npos) << watch.suspects();
    EXPECT_EQ(watch.suspects().find("encoder"), std::string::npos) << watch.suspects();
}

TEST(GravityWatch, TellsBeforeItRefuses) {
    estimator::Settings truth, believed;
    for (const auto& [off, warned, refused] : {std::tuple{0.19, false, false},
                                               {0.21, true, false},
                                               {0.49, true, false},
                                               {0.51, true, true}}) {
        truth.encoder_zero_deg = {off, 0, 0};
        GravityWatch watch(believed, {});
        const auto verdict = watch.judge(second_at(truth, {45, 0, 0}), {}, true);
        EXPECT_EQ(verdict.warned, warned) << off;
        EXPECT_EQ(verdict.refused, refused) << off;
        EXPECT_NEAR(verdict.angle_deg, off, 1e-9);
    }
}

}  // namespace
}  // namespace vibrig::campaign
