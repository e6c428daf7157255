#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "tests/plant/rig.hpp"

namespace vibrig::plant {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kRad = std::numbers::pi / 180;
constexpr double kSecond = kRad / 3600;  ///< an arcsec
const Vec3 kGoldenAngles{30 * kRad, 10 * kRad, -20 * kRad};

Truth quiet() {
    Truth truth;
    truth.resolver_arcsec = 0;
    truth.resolver_bits = 24;
    truth.gyro_random_walk_deg_per_rt_h = 0;
    truth.accelerometer_g = 0;
    truth.table_accelerometer_g = 0;
    return truth;
}

/// One period at 15 Hz with 6 g, in phase and ahead.
std::vector<Shake> period() {
    std::vector<Shake> shakes(101);
    for (std::size_t i = 0; i < shakes.size(); ++i) {
        const double phase = kTwoPi * static_cast<double>(i) / 100;
        shakes[i] = {6 * std::sin(phase), 6 * std::cos(phase)};
    }
    return shakes;
}

/// Mean angle rates over one period about the golden angles, arcsec/s.
Vec3 rates_over_a_period(const Truth& truth) {
    PlatformModel model(truth);
    const double dt = 1.0 / 15;
    Vec3 rate{};
    for (int again = 0; again < 3; ++again) {  // so that the golden angles are those of the middle
        const Vec3 start = kGoldenAngles - (0.5 * dt * kSecond) * rate;
        model.set_angles(start);
        model.advance(dt, period(), {});
        rate = (1 / (dt * kSecond)) * (model.angles() - start);
    }
    return rate;
}

/// The same from forces at 720 phases, each put through the gyros by itself; `force_at` is in
/// platform axes.
template <class Force>
Vec3 rates_by_phases(const Truth& truth, Force&& force_at, const Vec3& extra = {}) {
    PlatformModel model(truth);
    model.set_angles(kGoldenAngles);
    Vec3 drift{};
    for (int i = 0; i < 720; ++i)
        drift = drift + (1.0 / 720) * model.drift_under(force_at(model, i * kTwoPi / 720));
    const Vec3 still = model.gyro_drift(model.up_in_platform(), 0);
    return (1 / kSecond) *
           model.angle_rates(kGoldenAngles, 0, truth.drift_sign * (drift - still) + extra);
}

void expect_near(const Vec3& found, const Vec3& expected, double tolerance) {
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(found[i], expected[i], tolerance) << i;
}

// Up is +y: north is x, east is z.
TEST(Misfit, CrossAxisMotionInPhaseGivesTheRatesOfTheFullSecondMoment) {
    // GIVEN 5 % to north and 10 % to east
    Truth truth;
    truth.cross_axis = {0.05, 0.1};
    // THEN the rates are those of kappa 19 and Gamma = c c', c = (0.05, 1, 0.1)
    expect_near(rates_over_a_period(truth), {11.917586417, 9.071095600, 6.185667387}, 2e-8);
}

TEST(Misfit, CrossAxisMotionInQuadratureAddsItsOwnSquareOnly) {
    Truth truth;
    truth.cross_axis_quadrature = {0.2, -0.1};
    const auto force = [](const PlatformModel& model, double phase) {
        return model.seen(kGoldenAngles, {0.2 * 6 * std::cos(phase), 1 + 6 * std::sin(phase),
                                          -0.1 * 6 * std::cos(phase)});
    };
    expect_near(rates_over_a_period(truth), rates_by_phases(truth, force), 1e-7);
    EXPECT_GT(std::abs(rates_over_a_period(truth)[0] - rates_over_a_period(Truth{})[0]), 1e-4);
}

TEST(Misfit, ATiltedVibrationKeepsItsSizeAndLeansAsStated) {
    Truth truth;
    truth.tilt_deg = {0.5, -1};
    PlatformModel model(truth);
    const Vec3 felt = model.force({1, 0}) - model.force({0, 0});
    EXPECT_NEAR(dot(felt, felt), 1, 1e-12);
    EXPECT_NEAR(felt[0] / felt[1], std::tan(0.5 * kRad), 1e-12);
    EXPECT_NEAR(felt[2] / felt[1], std::tan(-1 * kRad), 1e-12);
}

TEST(Misfit, ACubicTermIsRectifiedThreeKappaMinusTwoTimes) {
    // GIVEN 1e-3 deg/h/g^3 along input, output and spin of gyro x, y, z in turn
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        Truth truth;
        truth.cubic_deg_h_g3[gyro][gyro] = 1e-3;
        PlatformModel model(truth);
        model.set_angles(kGoldenAngles);
        const Axis axis = truth.gyro_axes[gyro][gyro];
        const double a = axis.sign * model.up_in_platform()[static_cast<std::size_t>(axis.index)];
        Vec3 drift{};
        drift[gyro] = 1e-3 * a * a * a * (3 * 19 - 2);
        const Vec3 none = model.earth_rate_in_platform(kGoldenAngles);
        const Vec3 still = model.gyro_drift(model.up_in_platform(), 0);
        // angle_rates takes drift at rest and Earth along: what is added is linear
        const Vec3 expected =
            rates_over_a_period(Truth{}) +
            (1 / kSecond) * (model.angle_rates(kGoldenAngles, 0, none + still - drift) -
                             model.angle_rates(kGoldenAngles, 0, none + still));
        expect_near(rates_over_a_period(truth), expected, 1e-7);
    }
}

Mat3 product(const Mat3& a, const Mat3& b) {
    Mat3 c{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
            for (std::size_t k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
        }
    }
    return c;
}
Mat3 turned(std::size_t axis, double angle) {
    const std::size_t j = (axis + 1) % 3, k = (axis + 2) % 3;
    Mat3 m{};
    m[axis][axis] = 1;
    m[j][j] = m[k][k] = std::cos(angle);
    m[j][k] = -std::sin(angle);
    m[k][j] = std::sin(angle);
    return m;
}

TEST(Misfit, AxesThatAreNotSquareTurnAsTheProductOfTheirRotations) {
    // GIVEN 20 and -50 arcmin between the axes
    Truth truth;
    truth.coefficients = {};
    truth.non_orthogonality_arcsec = {1200, -3000};
    const PlatformModel model(truth);
    const Vec3 angles{0.7, -0.4, 2.1};
    const Mat3 expected =
        product(turned(2, angles[2]),
                product(turned(0, -3000 * kSecond),
                        product(turned(1, angles[1]),
                                product(turned(2, 1200 * kSecond), turned(0, angles[0])))));
    const Vec3 reference{0.3, -0.5, 0.8};
    expect_near(model.seen(angles, reference), expected * reference, 1e-14);
    // AND their rates are those of the derivative: d(seen)/dt = seen x rate
    const Vec3 rate{2e5, -1e5, 3e5};
    const Vec3 angle_rate =
        model.angle_rates(angles, 0, rate + model.earth_rate_in_platform(angles));
    const double h = 1e-4;
    const Vec3 derivative = (0.5 / h) * (model.seen(angles + h * angle_rate, reference) -
                                         model.seen(angles - h * angle_rate, reference));
    expect_near(derivative, cross(model.seen(angles, reference), kSecond * rate), 1e-7);
}

/// Rotation by a vector, Rodrigues.
Mat3 rotation(const Vec3& v) {
    const double angle = std::sqrt(dot(v, v));
    const double s = std::sin(angle) / angle, c = (1 - std::cos(angle)) / (angle * angle);
    Mat3 m{};
    for (std::size_t i = 0; i < 3; ++i) {
        Vec3 e{};
        e[i] = 1;
        const Vec3 column = e + s * cross(v, e) + c * cross(v, cross(v, e));
        for (std::size_t row = 0; row < 3; ++row) m[row][i] = column[row];
    }
    return m;
}

TEST(Misfit, APlatformThatRocksFeelsTurnedForcesAndConing) {
    // GIVEN 10 arcsec/g about x in phase and 20 about y ahead: at 6 g 60 and 120 arcsec
    Truth truth;
    truth.platform_rocking_arcsec_g = {10, 0, 0};
    truth.platform_rocking_quadrature_arcsec_g = {0, 20, 0};
    const auto turn = [](double phase) {
        return Vec3{60 * kSecond * std::sin(phase), 120 * kSecond * std::cos(phase), 0};
    };
    // WHEN the rotation itself is followed through a period, what do its gyros feel in the mean?
    Vec3 felt{};
    const int steps = 3600;
    for (int i = 0; i < steps; ++i) {
        const Mat3 a = rotation(turn(i * kTwoPi / steps));
        const Mat3 b = rotation(turn((i + 1) * kTwoPi / steps));
        for (std::size_t k = 0; k < 3; ++k) {  // of a'b the part that is skew
            const std::size_t x = (k + 1) % 3, y = (k + 2) % 3;
            double yx = 0, xy = 0;
            for (std::size_t row = 0; row < 3; ++row) {
                yx += a[row][y] * b[row][x];
                xy += a[row][x] * b[row][y];
            }
            felt[k] += 0.5 * (yx - xy);
        }
    }
    felt = (15 / kSecond) * felt;  // deg/h
    EXPECT_GT(std::abs(felt[2]), 0.1);
    // THEN the loop, which holds them at zero, turns the platform the other way
    const auto force = [&](const PlatformModel& model, double phase) {
        const Vec3 f = model.seen(kGoldenAngles, {0, 1 + 6 * std::sin(phase), 0});
        const Mat3 r = rotation(turn(phase));
        return Vec3{r[0][0] * f[0] + r[1][0] * f[1] + r[2][0] * f[2],
                    r[0][1] * f[0] + r[1][1] * f[1] + r[2][1] * f[2],
                    r[0][2] * f[0] + r[1][2] * f[1] + r[2][2] * f[2]};
    };
    // 120 arcsec are 6e-4: what is of second order in the turn is 4e-7 of 19 deg/h; and 100 chords
    // for a circle leave out (2 pi / 100)^2 / 6 of the coning's 1.6 deg/h
    const Vec3 rates = rates_over_a_period(truth);
    expect_near(rates, rates_by_phases(truth, force, -1 * felt), 1.2e-3);
    EXPECT_GT(std::abs(rates[2] - rates_by_phases(truth, force)[2]), 1);
}

void shake_up(Rig& rig, std::uint32_t tenths_of_mg) {
    const std::array<std::uint16_t, 4> words{static_cast<std::uint16_t>(tenths_of_mg >> 16),
                                             static_cast<std::uint16_t>(tenths_of_mg), 100, 1};
    ASSERT_EQ(rig.shaker().write(2, words), ShakerController::Answer::accepted);
}

/// Complex amplitude at 15 Hz of what `value` says, over 8 samples, three periods.
template <class Value>
std::complex<double> lock_in(Rig& rig, Value&& value) {
    std::complex<double> sum = 0;
    for (int i = 0; i < 8; ++i) {
        rig.advance();
        sum += 0.25 * value(rig.readings()) *
               std::polar(1.0, -kTwoPi * 15 * 0.025 * static_cast<double>(rig.tick()));
    }
    return sum;
}
std::complex<double> shaken(const Truth& truth, std::size_t axis) {
    Rig rig(truth);
    shake_up(rig, 90000);
    for (int i = 0; i < 200; ++i) rig.advance();
    return lock_in(rig, [axis](const Readings& r) { return r.raw_g[axis]; });
}

TEST(Misfit, AccelerometersShowVibrationWithTheirGainAndLate) {
    Truth truth = quiet();
    const std::complex<double> right = shaken(truth, 1);
    EXPECT_NEAR(std::abs(right), 6, 1e-6);
    truth.vibration_gain = 0.95;
    truth.latency_s = 0.002;
    // 2 ms are 10.8 deg at 15 Hz
    EXPECT_NEAR(std::abs(shaken(truth, 1) / right - std::polar(0.95, -10.8 * kRad)), 0, 1e-6);
    // AND gravity as it is
    Rig rig(truth);
    EXPECT_NEAR(rig.readings().raw_g[1], 1, 1e-12);
}

TEST(Misfit, AccelerometersSeeCrossAxisMotionAndItsPhase) {
    Truth truth = quiet();
    truth.cross_axis = {0.05, 0};
    truth.cross_axis_quadrature = {0, -0.1};
    const std::complex<double> up = shaken(truth, 1);
    EXPECT_NEAR(std::abs(shaken(truth, 0) / up - 0.05), 0, 1e-6);
    EXPECT_NEAR(std::abs(shaken(truth, 2) / up - std::complex<double>(0, -0.1)), 0, 1e-6);
}

TEST(Misfit, ABaseThatRocksMovesTheResolversOnly) {
    // GIVEN 10 arcsec/g about north, which is the outer axis, and 5 ahead about east
    Truth truth = quiet();
    truth.base_rocking_arcsec_g = {10, 0, 0};
    truth.base_rocking_quadrature_arcsec_g = {0, 0, 5};
    Truth firm = quiet();
    Rig rocking(truth);
    Rig still(firm);
    for (Rig* rig : {&rocking, &still}) {
        rig->release();
        shake_up(*rig, 90000);
        for (int i = 0; i < 200; ++i) rig->advance();
    }
    const auto angle = [](std::size_t axis) {
        return [axis](const Readings& r) { return std::remainder(r.encoder_deg[axis], 360.0); };
    };
    // WHEN 6 g vibrate THEN the resolvers move by 60 and 30 arcsec, counted to 0.08
    Rig a = rocking, b = still, c = rocking;
    const std::complex<double> up = lock_in(a, [](const Readings& r) { return r.raw_g[1]; });
    const std::complex<double> outer = lock_in(rocking, angle(0)) - lock_in(b, angle(0));
    EXPECT_NEAR(std::abs(outer * 3600.0 / up - 10.0), 0, 0.02);
    const std::complex<double> azimuth = lock_in(c, angle(2)) - lock_in(still, angle(2));
    EXPECT_NEAR(std::abs(azimuth * 3600.0 / up - std::complex<double>(0, 5)), 0, 0.02);
    // AND platform and forces are what they were
    EXPECT_EQ(rocking.platform().angles(), b.platform().angles());
    EXPECT_EQ(rocking.readings().raw_g, b.readings().raw_g);
}

TEST(Misfit, HarmonicsOfTheTableComeAtTheirOwnFrequencies) {
    Truth truth = quiet();
    truth.frequency_hz = 15;
    truth.second_harmonic = 0.05;
    truth.third_harmonic = 0.04;
    truth.fourth_harmonic = 0.03;
    truth.fifth_harmonic = 0.02;
    Rig rig(truth);
    shake_up(rig, 10000);
    for (int i = 0; i < 400; ++i) rig.advance();
    // WHEN 1 s of the table, 15 periods, is compared with the sum of its parts
    for (int i = 0; i < 40; ++i) {
        rig.advance();
        const double phase = kTwoPi * 15 * 0.025 * static_cast<double>(rig.tick());
        EXPECT_NEAR(rig.readings().table_g,
                    std::sin(phase) + 0.05 * std::sin(2 * phase) + 0.04 * std::sin(3 * phase) +
                        0.03 * std::sin(4 * phase) + 0.02 * std::sin(5 * phase),
                    1e-6);
    }
}

TEST(Misfit, AmplitudeAndFrequencyDriftSinceTheStart) {
    // GIVEN 5 % and 0.2 Hz in 100 s
    Truth truth = quiet();
    truth.amplitude_drift_per_h = 1.8;
    truth.frequency_drift_hz_per_h = 7.2;
    Rig rig(truth);
    shake_up(rig, 10000);
    for (int i = 0; i < 4000; ++i) {
        rig.advance();
        const double t = 0.025 * static_cast<double>(rig.tick());
        if (t < 90) continue;
        const double phase = kTwoPi * (15 * t + 0.5 * 0.002 * t * t);
        // The frequency goes on in steps of a tick, half a tick early: 2 pi 0.002 Hz/s 12.5 ms 100
        // s
        EXPECT_NEAR(rig.readings().table_g, (1 + 0.0005 * t) * std::sin(phase), 0.02);
    }
}

TEST(Misfit, ResolversErrOncePerTurnTwiceAndSixteenTimes) {
    Truth truth = quiet();
    truth.harmonic_1_arcsec = {20, 0, 0};
    truth.harmonic_2_arcsec = {0, 10, 0};
    truth.harmonic_2_phase_deg = {0, 30, 0};
    truth.harmonic_16_arcsec = {3, 0, 5};
    truth.harmonic_16_phase_deg = {-90, 0, 180};
    Sensors sensors(truth, 1);
    const double count = 360 * 3600.0 / (1 << 24);
    for (double angle = 1.5; angle < 360; angle += 7.3) {
        const Vec3 shown = sensors.read({angle, angle, angle}, {}, 0, 0).encoder_deg;
        const auto error = [&](std::size_t i) { return 3600 * (shown[i] - angle); };
        EXPECT_NEAR(error(0), 20 * std::cos(angle * kRad) + 3 * std::sin(16 * angle * kRad), count);
        EXPECT_NEAR(error(1), 10 * std::cos((2 * angle + 30) * kRad), count);
        EXPECT_NEAR(error(2), -5 * std::cos(16 * angle * kRad), count);
    }
}

TEST(Misfit, AClockThatGainsShowsSlowerDrift) {
    Truth truth = quiet();
    Rig right(truth);
    truth.time_base = 0.01;
    Rig gaining(truth);
    for (Rig* rig : {&right, &gaining}) {
        rig->release();
        for (int i = 0; i < 400; ++i) rig->advance();
    }
    EXPECT_EQ(right.time_us(), gaining.time_us());
    for (std::size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(gaining.platform().angles()[i] / right.platform().angles()[i], 1 / 1.01, 2e-5);
}

TEST(Misfit, ABaseThatLeansTurnsGravityAndEarthTogether) {
    // GIVEN 1 deg about north: the base's up leans to the south of east, gravity in it the other
    // way
    Truth truth;
    truth.base_tilt_deg = {1, 0};
    const PlatformModel model(truth);
    expect_near(model.up_at({}), {0, std::cos(1 * kRad), -std::sin(1 * kRad)}, 1e-12);
    const PlatformModel level{Truth{}};
    EXPECT_NEAR(dot(model.up_at({}), model.earth_rate()), dot(level.up_at({}), level.earth_rate()),
                1e-12);
    EXPECT_NEAR(model.earth_rate()[0], level.earth_rate()[0], 1e-12) << "north is the axis";
    EXPECT_NEAR(model.earth_rate()[2], -level.earth_rate()[1] * std::sin(1 * kRad), 1e-12);
    // AND it vibrates along its own vertical
    expect_near(model.force({1, 0}) - model.force({0, 0}), {0, 1, 0}, 1e-12);
}

TEST(Misfit, ChannelsAndCommandsGoToTheGimbalsTheyAreWiredTo) {
    // GIVEN channel Outer showing the azimuth gimbal, commands for Outer going to the inner one, 2
    // deg off
    Truth truth = quiet();
    truth.channel = {GimbalAxis::azimuth, GimbalAxis::inner, GimbalAxis::outer};
    truth.command_channel = {GimbalAxis::inner, GimbalAxis::outer, GimbalAxis::azimuth};
    truth.command_offset_deg = {0, 2, 0};
    truth.dead = Axis{1, 1};
    Rig rig(truth);
    rig.slew_to({10, 20, 30});
    for (int i = 0; i < 400; ++i) rig.advance();
    expect_near((1 / kRad) * rig.platform().angles(), {20, 12, 30}, 1e-9);
    expect_near(rig.readings().encoder_deg, {30, 12, 20}, 1e-4);
    EXPECT_TRUE(rig.gimbals().in_position());
    EXPECT_EQ(rig.readings().raw_g[1], 0) << "dead";
    EXPECT_NE(rig.readings().raw_g[0], 0);
}

TEST(Misfit, AReadingCountsInItsUnitAndBeginsAnewAfter360) {
    Truth truth = quiet();
    truth.angle_unit = {AngleUnit::turn, AngleUnit::rad, AngleUnit::twice};
    Rig rig(truth);
    rig.slew_to({90, 20, 200});  // commands count in deg
    for (int i = 0; i < 2000; ++i) rig.advance();
    expect_near(rig.readings().encoder_deg, {0.25, 20 / 57.29577951, 40}, 1e-3);
    truth.angle_unit = {AngleUnit::gon, AngleUnit::arcmin, AngleUnit::half};
    Rig other(truth);
    other.slew_to({90, 5, 200});
    for (int i = 0; i < 2000; ++i) other.advance();
    expect_near(other.readings().encoder_deg, {100, 300, 100}, 0.05);
}

TEST(Misfit, AGimbalThatIsStuckStaysAndTheOthersMove) {
    Truth truth = quiet();
    truth.stuck_gimbal = GimbalAxis::inner;
    Rig rig(truth);
    rig.slew_to({10, 20, 30});
    for (int i = 0; i < 800; ++i) rig.advance();
    expect_near((1 / kRad) * rig.platform().angles(), {10, 0, 30}, 1e-9);
    EXPECT_FALSE(rig.gimbals().in_position());
}

TEST(Misfit, ALateSlowVibrationIsStillTheOneOfThePast) {
    // The largest latency is a whole tick: what the sample before showed.
    Truth truth = quiet();
    Truth late = truth;
    late.latency_s = 0.025;
    Rig a(truth), b(late);
    for (Rig* rig : {&a, &b}) shake_up(*rig, 90000);
    double before = 0;
    for (int i = 0; i < 100; ++i) {
        a.advance();
        b.advance();
        if (i > 1) {
            EXPECT_NEAR(b.readings().raw_g[1], before, 1e-9);
        }
        before = a.readings().raw_g[1];
    }
}

}  // namespace
}  // namespace vibrig::plant
