#include "tests/plant/rig.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace vibrig::plant {
namespace {

Truth without_noise() {
    Truth truth;
    truth.resolver_arcsec = 0;
    truth.gyro_random_walk_deg_per_rt_h = 0;
    truth.accelerometer_g = 0;
    truth.table_accelerometer_g = 0;
    return truth;
}
void run_for(Rig& rig, double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += 0.025) rig.advance();
}
void start(Rig& rig, std::uint32_t tenths_of_mg) {
    const std::array<std::uint16_t, 4> words{static_cast<std::uint16_t>(tenths_of_mg >> 16),
                                             static_cast<std::uint16_t>(tenths_of_mg), 100, 1};
    ASSERT_EQ(rig.shaker().write(2, words), ShakerController::Answer::accepted);
}

TEST(Gimbals, StopAtASoftStopAndAreNeverInPositionBeyondIt) {
    // GIVEN a stop 60 deg either way of an encoder reading of 170
    Gimbals gimbals(5, std::nullopt, {{170, 0, 0}, {60, 360, 360}});
    Vec3 angle{170, 0, 0};
    gimbals.slew_to({260, 10, 0});
    for (int n = 0; n < 400; ++n) gimbals.advance(0.1, angle);
    // THEN it stands there, the others go where they were sent
    EXPECT_NEAR(angle[0], 230, 1e-9);
    EXPECT_NEAR(angle[1], 10, 0.006);
    EXPECT_FALSE(gimbals.in_position());
    // AND comes back, and stops at the other end
    gimbals.slew_to({90, 0, 0});
    for (int n = 0; n < 400; ++n) gimbals.advance(0.1, angle);
    EXPECT_NEAR(angle[0], 110, 1e-9);
    EXPECT_FALSE(gimbals.in_position());
    gimbals.slew_to({150, 0, 0});
    for (int n = 0; n < 400; ++n) gimbals.advance(0.1, angle);
    EXPECT_TRUE(gimbals.in_position());
}

TEST(Gimbals, SlewAtFiniteRateTheShorterWayRound) {
    // GIVEN gimbals at 5 deg/s
    Gimbals gimbals(5);
    Vec3 angle{10, 0, 350};
    gimbals.slew_to({350, -3, 5});
    EXPECT_TRUE(gimbals.slewing());
    // WHEN they slew for 1 s THEN each has moved 5 deg at most, across zero where that is shorter
    for (int i = 0; i < 40; ++i) gimbals.advance(0.025, angle);
    EXPECT_NEAR(angle[0], 5, 1e-9);
    EXPECT_NEAR(angle[1], -3, 1e-9);
    EXPECT_NEAR(angle[2], 355, 1e-9);
    EXPECT_FALSE(gimbals.in_position());
    // THEN after 20 deg / 5 deg/s they are in position and hold
    int arrivals = 0;
    for (int i = 0; i < 200; ++i) arrivals += gimbals.advance(0.025, angle) ? 1 : 0;
    EXPECT_EQ(arrivals, 1);
    EXPECT_TRUE(gimbals.in_position());
    EXPECT_NEAR(std::remainder(angle[0] - 350, 360), 0, 1e-9);
    gimbals.release();
    EXPECT_FALSE(gimbals.in_position());
    EXPECT_FALSE(gimbals.slewing());
}

TEST(Sensors, AnglesAreQuantisedAndWrapped) {
    const double step = 360.0 / (1 << 20);
    EXPECT_EQ(quantise_angle(0, 20), 0);
    EXPECT_EQ(quantise_angle(360, 20), 0);
    EXPECT_EQ(quantise_angle(-0.4 * step, 20), 0);
    EXPECT_EQ(quantise_angle(-0.6 * step, 20), 360 - step);
    EXPECT_EQ(quantise_angle(-45, 20), 315);
    EXPECT_EQ(quantise_angle(725, 20), quantise_angle(5, 20));
    EXPECT_NEAR(quantise_angle(123.4567, 20), 123.4567, step / 2);
    EXPECT_EQ(quantise_angle(1.4 * step, 20), step);
}

TEST(Sensors, ErrorsOfTheAccelerometersAreUndoneAsTheConfigurationDoes) {
    // GIVEN zeros and a matrix
    Truth truth = without_noise();
    truth.zero_g = {1e-3, -2e-3, 5e-4};
    truth.matrix = {{{1.001, 2e-4, 0}, {0, 0.999, -3e-4}, {1e-4, 0, 1.002}}};
    Sensors sensors(truth, 1);
    // WHEN matrix * (raw - zero) is formed THEN it is the force along the platform axes
    const Vec3 force{0.1, 1.2, -0.4};
    const Readings readings = sensors.read({0, 0, 0}, force, 0, 0);
    const Vec3 back = truth.matrix * (readings.raw_g - truth.zero_g);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(back[i], force[i], 1e-12);
}

TEST(Sensors, NoiseHasItsStandardDeviation) {
    // GIVEN 5 arcsec and 1e-4 g, seed 3
    SCOPED_TRACE("seed 3");
    Sensors sensors(Truth{}, 3);
    const int n = 20000;
    double angle2 = 0;
    double force2 = 0;
    for (int i = 0; i < n; ++i) {
        const Readings r = sensors.read({10, 20, 30}, {0, 1, 0}, 0, 0);
        angle2 += std::pow((r.encoder_deg[2] - 30) * 3600, 2) / n;
        force2 += std::pow(r.raw_g[1] - 1, 2) / n;
    }
    // THEN the variances are sigma^2 + LSB^2/12 and sigma^2 within four standard deviations of
    // their estimate
    const double band = 4 * std::sqrt(2.0 / n);
    EXPECT_NEAR(angle2 / (25 + 1.236 * 1.236 / 12), 1, band);
    EXPECT_NEAR(force2 / 1e-8, 1, band);
}

TEST(Rig, IsTheSameBitForBitForASeed) {
    // GIVEN two rigs of one seed and a third of another, WHEN all do the same
    Truth truth;
    truth.seed = 42;
    Rig a(truth);
    Rig b(truth);
    truth.seed = 43;
    Rig c(truth);
    bool differs = false;
    for (Rig* rig : {&a, &b, &c}) {
        rig->release();
        start(*rig, 90000);
    }
    for (int i = 0; i < 400; ++i) {
        a.advance();
        b.advance();
        c.advance();
        ASSERT_EQ(a.readings().encoder_deg, b.readings().encoder_deg);
        ASSERT_EQ(a.readings().raw_g, b.readings().raw_g);
        ASSERT_EQ(a.readings().table_g, b.readings().table_g);
        differs = differs || a.readings().raw_g != c.readings().raw_g;
    }
    EXPECT_TRUE(differs);
}

TEST(Rig, HoldsWhileCagedAndDriftsWhenReleased) {
    // GIVEN a rig without noise, caged at (45, 0, 90)
    Rig rig(without_noise());
    rig.slew_to({45, 0, 90});
    run_for(rig, 20);
    ASSERT_TRUE(rig.gimbals().in_position());
    const Vec3 caged = rig.platform().angles();
    run_for(rig, 10);
    EXPECT_EQ(rig.platform().angles(), caged);
    // WHEN released at rest for 10 s THEN it drifts at the rate of the model
    rig.release();
    run_for(rig, 10);
    const Vec3 rate = rig.platform().angle_rates(caged, 0, {});
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR((rig.platform().angles()[i] - caged[i]) / 10, rate[i],
                    1e-3 * std::abs(rate[i]) + 1e-9);
    }
}

TEST(Rig, TorqueTurnsThePlatformAtTheCommandedRate) {
    Rig plain(without_noise());
    Rig torqued(without_noise());
    plain.release();
    torqued.release();
    torqued.torque({0, 0, 100});  // deg/h about platform z, which is minus gamma
    run_for(plain, 10);
    run_for(torqued, 10);
    const double arcsec = 180 * 3600 / 3.14159265358979;
    EXPECT_NEAR((torqued.platform().angles()[2] - plain.platform().angles()[2]) * arcsec, -1000,
                0.1);
}

/// Sums of the increments over so many seconds in mode calibrate.
Increment sum_of_increments(Rig& rig, double seconds) {
    Increment sum;
    sum.count = 0;
    for (double t = 0; t < seconds - 1e-9; t += 0.025) {
        rig.advance();
        for (const Increment& i : rig.increments()) {
            ++sum.count;
            sum.turn_arcsec = sum.turn_arcsec + i.turn_arcsec;
            sum.velocity_mps = sum.velocity_mps + i.velocity_mps;
        }
    }
    return sum;
}

TEST(Rig, IncrementsAreThoseOfTheEarthTheDriftTheSlewAndGravity) {
    // GIVEN a rig without noise with the azimuth axis vertical, zeros and a wrong sign somewhere
    Truth truth = without_noise();
    truth.zero_g = {0.005, -0.005, 0.002};
    for (const int sign : {1, -1}) {
        truth.increment_sign = {sign, 1, 1};
        Rig rig(truth);
        rig.slew_to({90, 0, 0});
        run_for(rig, 30);
        EXPECT_TRUE(rig.increments().empty()) << "not asked for";
        rig.slew_to({90, 0, 0}, GimbalMode::calibrate);
        run_for(rig, 1);
        // WHEN it stands for 100 s
        const Increment still = sum_of_increments(rig, 100);
        // THEN 100 a second, the Earth's rate plus drift (1 deg/h is 1 arcsec/s), g plus the zeros
        EXPECT_EQ(still.count, 10'000U);
        const PlatformModel& platform = rig.platform();
        const Vec3 rate = platform.earth_rate_in_platform(platform.angles()) +
                          platform.gyro_drift(platform.up_in_platform(), 0);
        const Vec3 up = platform.up_in_platform();
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_NEAR(still.turn_arcsec[i], (i == 0 ? sign : 1) * 100 * rate[i], 0.01) << i;
            EXPECT_NEAR(still.velocity_mps[i], 100 * 9.80665 * (up[i] + truth.zero_g[i]), 1e-4);
        }
        // WHEN the azimuth slews by 90 deg, 18 s, and stands for 2 s
        rig.slew_to({90, 0, 90}, GimbalMode::calibrate);
        const Increment turned = sum_of_increments(rig, 20);
        // THEN the platform has turned by that much against its gimbal, besides what it does anyway
        EXPECT_NEAR(turned.turn_arcsec[2] - 20 * rate[2], -90 * 3600, 0.05);
        // AND the vertical accelerometer saw gravity only
        EXPECT_NEAR(turned.velocity_mps[2], 20 * 9.80665 * 1.002, 0.01);
        // AND on over half a turn, where the angle begins anew: its inner gimbal beside level, too
        rig.slew_to({90, 0.3, 170}, GimbalMode::calibrate);
        run_for(rig, 20);
        rig.slew_to({90, 0.3, -170}, GimbalMode::calibrate);
        const Increment over = sum_of_increments(rig, 10);
        EXPECT_NEAR(over.turn_arcsec[2] - 10 * rate[2], -20 * 3600 * std::cos(0.3 / 57.3), 2);
        EXPECT_NEAR(over.velocity_mps[2], 10 * 9.80665 * 1.002, 0.01);
        // AND released it says nothing
        rig.release();
        rig.advance();
        EXPECT_TRUE(rig.increments().empty());
    }
}

TEST(Rig, TorquersTheWrongWayRoundAndSlewErrorsAreAsTheTruthSays) {
    Truth truth = without_noise();
    truth.torquer_scale = {1, 1, -0.5};
    Rig plain(truth);
    Rig torqued(truth);
    plain.release();
    torqued.release();
    torqued.torque({0, 0, 100});
    run_for(plain, 10);
    run_for(torqued, 10);
    const double arcsec = 180 * 3600 / 3.14159265358979;
    EXPECT_NEAR((torqued.platform().angles()[2] - plain.platform().angles()[2]) * arcsec, 500, 0.1);
    // A slew ends off by its error, each slew by another one, a command said again by the same; an
    // axis that need not move has none.
    truth.slew_error_deg = 0.2;
    double squares = 0;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
        truth.seed = seed;
        Rig rig(truth);
        rig.slew_to({1, 1, 0});
        run_for(rig, 1);
        const Vec3 first = rig.platform().angles();
        rig.slew_to({1, 1, 0});
        run_for(rig, 1);
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_NEAR(rig.platform().angles()[i], first[i], 0.005 / 57.2);  // in position
        squares += std::pow(first[1] * arcsec / 3600 - 1, 2);
        EXPECT_NEAR(first[2], 0, 1e-6);
    }
    // chi-square of 100: 99.9 % band
    EXPECT_NEAR(std::sqrt(squares / 100), 0.2, 0.2 * 3.29 / std::sqrt(200.0));
}

TEST(Rig, VibratesWithTwoThirdsOfTheTable) {
    // GIVEN 9 g at the table after the transient
    Rig rig(without_noise());
    start(rig, 90000);
    run_for(rig, 4);
    // WHEN 8 samples (3 periods of 15 Hz at 40 Hz) are squared THEN the mean is kappa = 1 + 6^2/2
    double mean = 0;
    double table2 = 0;
    for (int i = 0; i < 8; ++i) {
        rig.advance();
        mean += dot(rig.readings().raw_g, rig.readings().raw_g) / 8;
        table2 += std::pow(rig.readings().table_g, 2) / 8;
    }
    EXPECT_NEAR(mean, 19, 1e-6);
    EXPECT_NEAR(table2, 81.0 / 2, 1e-6);
}

TEST(Rig, EncoderSignsAndZerosAreThoseOfTheConfiguration) {
    Truth truth = without_noise();
    truth.encoder_sign = {-1, 1, 1};
    truth.encoder_zero_deg = {10, 0, -20};
    Rig rig(truth);
    rig.slew_to({55, 0, 25});
    run_for(rig, 20);
    const double deg = 180 / 3.14159265358979323846;
    EXPECT_NEAR(rig.platform().angles()[0] * deg, -45, 1e-6);
    EXPECT_NEAR(rig.platform().angles()[2] * deg, 45, 1e-6);
    EXPECT_NEAR(rig.readings().encoder_deg[0], 55, 4e-4);
}

TEST(Rig, GetsReadyAndWarm) {
    Truth truth;
    truth.warm_up_s = 10;
    Rig rig(truth);
    EXPECT_FALSE(rig.ready());
    EXPECT_NEAR(rig.readings().temperature_c, 25, 1e-9);
    run_for(rig, 20);
    EXPECT_TRUE(rig.ready());
    EXPECT_NEAR(rig.readings().temperature_c, 45 - 20 * std::exp(-1.0), 1e-6);
}

}  // namespace
}  // namespace vibrig::plant
