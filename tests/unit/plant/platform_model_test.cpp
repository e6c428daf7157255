#include "tests/plant/platform_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace vibrig::plant {
namespace {

constexpr double kDeg = std::numbers::pi / 180;
constexpr double kArcsec = kDeg / 3600;

// Mean of the rate over a period of A1 = a0 sin: exact with eight phases, since A1 enters as a
// square at most.
Vec3 mean_rate(const PlatformModel& model, const Vec3& angles, double a0, const Vec3& extra = {}) {
    Vec3 mean{};
    for (int i = 0; i < 8; ++i) {
        mean = mean +
               0.125 * model.angle_rates(angles, a0 * std::sin(i * std::numbers::pi / 4), extra);
    }
    return mean;
}

Mat3 columns_in_platform(const Vec3& angles) {
    Mat3 c{};
    for (std::size_t column = 0; column < 3; ++column) {
        Vec3 axis{};
        axis[column] = 1;
        const Vec3 seen = PlatformModel::to_platform(angles, axis);
        for (std::size_t row = 0; row < 3; ++row) c[row][column] = seen[row];
    }
    return c;
}

TEST(PlatformModel, SeesTheReferenceAxesAsPublished) {
    // GIVEN the angles of the golden example, 30, 10 and -20 deg
    const Vec3 angles{30 * kDeg, 10 * kDeg, -20 * kDeg};
    const Mat3 expected{{{.925416578, .377786088, -.029695587},
                         {-.336824089, .784102094, -.521280576},
                         {-.173648178, .492403877, .852868532}}};
    // WHEN the reference axes are seen from the platform THEN they are the columns of C
    const Mat3 c = columns_in_platform(angles);
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(c[i][j], expected[i][j], 1e-9) << i << j;
    }
    PlatformModel model{Truth{}};
    model.set_angles(angles);
    EXPECT_NEAR(model.up_in_platform()[1], .784102094, 1e-9);
    const Vec3 earth = model.earth_rate_in_platform(angles);
    EXPECT_NEAR(earth[0], 13.782968518, 1e-8);
    EXPECT_NEAR(earth[1], 4.912731623, 1e-8);
    EXPECT_NEAR(earth[2], 3.482605825, 1e-8);
}

TEST(PlatformModel, GimbalRatesAgreeWithTheDerivativeOfTheRotation) {
    // GIVEN a platform without drift on an Earth whose rate is cancelled, turning at known rates
    Truth truth;
    truth.coefficients = {};
    const PlatformModel model(truth);
    for (const Vec3& angles : {Vec3{0.5, 0.2, -0.4}, Vec3{-2.0, -0.9, 3.0}, Vec3{3.0, 1.2, 1.0}}) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            Vec3 rate{};
            rate[axis] = 1e5;  // deg/h
            const Vec3 angle_rate =
                model.angle_rates(angles, 0, rate + model.earth_rate_in_platform(angles));
            // WHEN the rotation is differentiated numerically along the angle rates
            const double h = 1e-4;
            const Mat3 ahead = columns_in_platform(angles + h * angle_rate);
            const Mat3 behind = columns_in_platform(angles - h * angle_rate);
            const Mat3 here = columns_in_platform(angles);
            // THEN dC/dt = -[w x] C, column by column
            const Vec3 w = (1e5 * kArcsec) *
                           Vec3{axis == 0 ? 1.0 : 0, axis == 1 ? 1.0 : 0, axis == 2 ? 1.0 : 0};
            for (std::size_t column = 0; column < 3; ++column) {
                const Vec3 c{here[0][column], here[1][column], here[2][column]};
                const Vec3 expected = cross(c, w);
                for (std::size_t row = 0; row < 3; ++row) {
                    const double derivative = (ahead[row][column] - behind[row][column]) / (2 * h);
                    EXPECT_NEAR(derivative, expected[row], 1e-8);
                }
            }
        }
    }
}

TEST(PlatformModel, MeanRateOverAPeriodIsTheGoldenRate) {
    // GIVEN Table 2 and 6 g on the platform, so that the mean of (1 + A1)^2 is 19
    const PlatformModel model{Truth{}};
    const Vec3 angles{30 * kDeg, 10 * kDeg, -20 * kDeg};
    // WHEN the explicit vibration is averaged THEN the angle rates are the published ones, in
    // arcsec/s
    const Vec3 rate = (1 / kArcsec) * mean_rate(model, angles, 6);
    EXPECT_NEAR(rate[0], 12.04843677, 1e-7);
    EXPECT_NEAR(rate[1], 9.063777603, 1e-7);
    EXPECT_NEAR(rate[2], 6.074928865, 1e-7);
}

TEST(PlatformModel, ExplicitVibrationStaysWithinTheErrorOfTheAveragedModel) {
    // GIVEN 100 s at 15 Hz and 6 g, a whole number of periods
    PlatformModel explicit_model{Truth{}};
    const Vec3 start{30 * kDeg, 10 * kDeg, -20 * kDeg};
    explicit_model.set_angles(start);
    std::vector<Shake> shakes(51);
    for (int tick = 0; tick < 4000; ++tick) {
        for (std::size_t i = 0; i < shakes.size(); ++i) {
            const double time = 0.025 * tick + 0.5e-3 * static_cast<double>(i);
            shakes[i].in_phase = 6 * std::sin(2 * std::numbers::pi * 15 * time);
        }
        explicit_model.advance(0.025, shakes, {});
    }
    // WHEN the mean rate is integrated over the same time
    Vec3 averaged = start;
    const double h = 0.5;
    for (int i = 0; i < 200; ++i) {
        const Vec3 k1 = mean_rate(explicit_model, averaged, 6);
        const Vec3 k2 = mean_rate(explicit_model, averaged + (h / 2) * k1, 6);
        const Vec3 k3 = mean_rate(explicit_model, averaged + (h / 2) * k2, 6);
        const Vec3 k4 = mean_rate(explicit_model, averaged + h * k3, 6);
        averaged = averaged + (h / 6) * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    // THEN both agree to 4.6e-6 deg/h (arcsec/s) in the mean, but not exactly
    const Vec3 difference = (1 / (100 * kArcsec)) * (explicit_model.angles() - averaged);
    const double norm = std::sqrt(dot(difference, difference));
    EXPECT_LT(norm, 1.2e-5);
    EXPECT_GT(norm, 1e-8);
}

TEST(PlatformModel, OtherVerticalAxesPermuteNorthAndEast) {
    // GIVEN up along +z and a rig whose north axis points 30 deg east of north
    Truth truth;
    truth.up = {2, 1};
    truth.azimuth_deg = 30;
    const PlatformModel model(truth);
    const double level = 15.041067 * std::cos(45.75 * kDeg);
    // WHEN the gimbals are at zero THEN north is y and east is x
    const Vec3 earth = model.earth_rate_in_platform({});
    EXPECT_NEAR(earth[1], level * std::cos(30 * kDeg), 1e-9);
    EXPECT_NEAR(earth[0], -level * std::sin(30 * kDeg), 1e-9);
    EXPECT_NEAR(earth[2], 15.041067 * std::sin(45.75 * kDeg), 1e-9);
    // AND a minus sign of up turns east over
    truth.up = {2, -1};
    const Vec3 over = PlatformModel(truth).earth_rate_in_platform({});
    EXPECT_NEAR(over[1], earth[1], 1e-12);
    EXPECT_NEAR(over[0], -earth[0], 1e-12);
    EXPECT_NEAR(over[2], -earth[2], 1e-12);
}

TEST(PlatformModel, GyroAxesPickInputOutputAndSpin) {
    // GIVEN gyro y with input -z, output x, spin y and only linear terms
    Truth truth;
    truth.coefficients = {};
    truth.coefficients[1][kI] = 2;
    truth.coefficients[1][kO] = 3;
    truth.coefficients[1][kS] = 5;
    truth.gyro_axes[1] = {{{2, -1}, {0, 1}, {1, 1}}};
    const PlatformModel model(truth);
    // WHEN 1 g and the vibration lie along a direction THEN each term takes its own axis
    EXPECT_NEAR(model.gyro_drift({0.1, 0.2, 0.7}, 0.5)[1], 1.5 * (-2 * 0.7 + 3 * 0.1 + 5 * 0.2),
                1e-12);
}

TEST(PlatformModel, ATurnThatGoesOnIsThatOfTheSum) {
    // GIVEN angles all round WHEN they go on by little and by much THEN cosines and sines are those
    // of the sums
    for (int i = 0; i < 100; ++i) {
        const double x = 0.37 * i;
        const Vec3 angles{x, -2 * x, 5 * x};
        for (const double by : {0.0, 1e-12, 2e-6, 0.99e-4, 1.01e-4, 0.1, 2.0}) {
            const Vec3 step{by, -by, 0.5 * by};
            const auto further = PlatformModel::Turn(angles).further(step);
            const PlatformModel::Turn direct(angles + step);
            SCOPED_TRACE(by);
            // Rounding, and that of an angle of up to 200 rad.
            constexpr double kRounding = 5e-14;
            EXPECT_NEAR(further.ca, direct.ca, kRounding);
            EXPECT_NEAR(further.sa, direct.sa, kRounding);
            EXPECT_NEAR(further.cb, direct.cb, kRounding);
            EXPECT_NEAR(further.sb, direct.sb, kRounding);
            EXPECT_NEAR(further.cg, direct.cg, kRounding);
            EXPECT_NEAR(further.sg, direct.sg, kRounding);
        }
    }
}

}  // namespace
}  // namespace vibrig::plant
