#include "daemon/interlock/interlock.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <thread>

#include "daemon/rt/real_clock.hpp"
#include "test_bench.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

namespace vibrig::rt {
namespace {

constexpr drivers::Time kPeriod = 25 * drivers::kMillisecond;

struct InterlockTest : testing::Test {
    RealClock clock;
    std::unique_ptr<drivers::Waiter> control = clock.make_waiter();
    FakeShaker shaker;
    Interlock interlock{shaker, *control, {.table_g = 12.0, .witness = {.sample_period = kPeriod}}};
    drivers::Sample sample;
    drivers::PlatformStatus platform;

    InterlockTest() {
        sample.quality.fill(drivers::Quality::good);
        platform.loop_closed = true;
    }
};

TEST_F(InterlockTest, StopsAndWakesTheControlThreadOnAnOpenLoop) {
    interlock.guard(Guard::excitation);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
    EXPECT_EQ(shaker.stops_asked, 1U);
    EXPECT_TRUE(control->wait_until(clock.now() + drivers::kSecond));
}

TEST_F(InterlockTest, WhoSeesTheTripFindsItsStopOrdered) {
    bool seen_before = false;
    shaker.on_stop = [&] { seen_before = interlock.tripped() != Trip::none; };
    interlock.guard(Guard::excitation);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    EXPECT_EQ(shaker.stops_asked, 1U);
    EXPECT_FALSE(seen_before);
}

TEST_F(InterlockTest, StaysLatchedWithTheFirstCauseUntilAcknowledged) {
    interlock.guard(Guard::excitation);
    platform.loop_closed = false;
    interlock.check(sample, platform);
    platform.loop_closed = true;
    sample.table_accel = 13;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
    EXPECT_EQ(shaker.stops_asked, 1U);
    interlock.acknowledge({Trip::over_amplitude});
    EXPECT_EQ(interlock.tripped(), Trip::loop_open) << "another cause than the handled one stays";
    interlock.acknowledge(interlock.latched());
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, TakesANanForAnOverAmplitude) {
    interlock.guard(Guard::excitation);
    sample.table_accel = std::numeric_limits<double>::quiet_NaN();
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, TakesTwoReadingsOutOfTheirRangeWithinAMomentForAnOverAmplitude) {
    interlock.guard(Guard::excitation);
    const auto at = [&](drivers::Time time, drivers::Quality quality) {
        sample.time = drivers::kSecond + time;
        sample.quality[static_cast<std::size_t>(drivers::Channel::table_accel)] = quality;
        interlock.check(sample, platform);
    };
    // GIVEN one now and then, which a bit may be that fell over
    for (drivers::Time time = 0; time < 2 * drivers::kSecond; time += kPeriod)
        at(time, time % (200 * drivers::kMillisecond) == 0 ? drivers::Quality::out_of_range
                                                           : drivers::Quality::good);
    EXPECT_EQ(interlock.tripped(), Trip::none);
    at(2000 * drivers::kMillisecond, drivers::Quality::out_of_range);
    EXPECT_EQ(interlock.tripped(), Trip::none);
    at(2050 * drivers::kMillisecond, drivers::Quality::good);
    at(2075 * drivers::kMillisecond, drivers::Quality::out_of_range);
    EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
}

TEST_F(InterlockTest, AFaultThatAnotherStatusDeniedBeforeTheSampleStops) {
    interlock.guard(Guard::excitation);
    interlock.check(sample, platform);
    ASSERT_EQ(interlock.tripped(), Trip::none);
    platform.had_fault = true;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::platform_fault);
    interlock.acknowledge(interlock.latched());
    platform.had_fault = false;
    platform.loop_was_open = true;
    interlock.check(sample, platform);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
}

TEST_F(InterlockTest, TripsOnTheEmergencyStopAndOnALostBus) {
    interlock.guard(Guard::excitation);
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.emergency_stop_open = true;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::emergency_stop);
    interlock.acknowledge(interlock.latched());
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::can_lost);
}

TEST_F(InterlockTest, TheEmergencyStopTripsWhereTheAmplitudeIsNoNumberAnyMore) {
    // GIVEN a controller whose power stage was cut: it has no amplitude
    drivers::ShakerReading reading;
    reading.fresh = true;
    reading.measured_g = std::numeric_limits<double>::quiet_NaN();
    for (const Guard guard : {Guard::armed, Guard::excitation}) {
        interlock.guard(guard);
        // WHEN the chain is open in the same reply THEN it is that, and not a lost read-back
        reading.emergency_stop_open = true;
        interlock.check(reading);
        EXPECT_EQ(interlock.tripped(), Trip::emergency_stop);
        interlock.acknowledge(interlock.latched());
        // Without it, an amplitude that is no number is none within its limit.
        reading.emergency_stop_open = false;
        interlock.check(reading);
        EXPECT_EQ(interlock.tripped(), Trip::over_amplitude);
        interlock.acknowledge(interlock.latched());
    }
}

TEST_F(InterlockTest, TakesPlatformAndTableForNothingWhileNothingMayMove) {
    platform.loop_closed = false;
    sample.table_accel = 99;
    interlock.check(sample, platform);
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::none);
    EXPECT_EQ(shaker.stops_asked, 0U);
}

TEST_F(InterlockTest, WatchesEmergencyStopFaultsAndBusFromTheArmingOn) {
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.fault = 2;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::none);
    interlock.guard(Guard::armed);
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::shaker_fault);
    interlock.acknowledge(interlock.latched());
    interlock.lost_bus();
    EXPECT_EQ(interlock.tripped(), Trip::can_lost);
}

TEST_F(InterlockTest, MotionThatNobodyCommandedWaitsForNoRowsDwell) {
    auto rules = default_interlock();
    for (Rule& rule : rules)
        if (rule.condition == Trip::uncommanded) rule.dwell_s = 1;
    Interlock slow{shaker, *control, {12.0, drivers::kSecond, rules, {.sample_period = kPeriod}}};
    slow.uncommanded();
    EXPECT_EQ(slow.tripped(), Trip::uncommanded);
    EXPECT_EQ(slow.name_of(slow.latched()), "uncommanded");
    EXPECT_EQ(shaker.stops_asked, 1U);
}

TEST_F(InterlockTest, StopsAShakerThatNobodyCommanded) {
    // GIVEN a disarmed daemon and a shaker that runs, left over or started at its panel
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.running = true;
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::uncommanded);
    EXPECT_EQ(shaker.stops_asked, 1U);
    // WHEN the stop is on its way, THEN the same reading is no new trip
    interlock.acknowledge(interlock.latched());
    interlock.check(reading);
    EXPECT_EQ(interlock.tripped(), Trip::none);
}

TEST(TrippedValue, HasCauseRowAndValueOfOneTripWhoeverReadsWhenever) {
    // GIVEN two threads that trip different rows with different values, and one that acknowledges
    RealClock clock;
    const auto control = clock.make_waiter();
    FakeShaker shaker;
    Interlock interlock(shaker, *control,
                        {12.0,
                         drivers::kSecond,
                         {{"far", Trip::amplitude_off, Reaction::abort, 1, 0, true},
                          {"hot", Trip::temperature, Reaction::abort, 70, 0, true}},
                         {.sample_period = kPeriod}});
    interlock.guard(Guard::armed);
    interlock.command(1, {0, 0, 0});
    std::atomic<bool> over{false};
    std::thread shaker_thread([&] {
        drivers::ShakerReading reading;
        reading.valid = true;
        reading.measured_g = 2;  // 6.02 dB
        while (!over.load()) interlock.check(reading);
    });
    std::thread acquisition([&] {
        drivers::Sample sample;
        drivers::PlatformStatus platform;
        platform.temperature_time = 1;
        platform.temperature_c = 80;
        while (!over.load()) interlock.check(sample, platform);
    });
    // WHEN a third one reads all the while, THEN what it reads belongs together
    std::array<int, 2> seen{};
    std::string wrong;
    const auto deadline = clock.now() + 60 * drivers::kSecond;
    while (wrong.empty() && (seen[0] < 2'000 || seen[1] < 2'000) && clock.now() < deadline) {
        const auto trip = interlock.latched();
        if (!trip) continue;
        const auto words = interlock.name_of(trip) + ": " + interlock.text_of(trip);
        if (words == "far: amplitude off command: 6.021, limit 1 dB") {
            ++seen[0];
        } else if (words == "hot: platform temperature: 80, limit 70 degC") {
            ++seen[1];
        } else {
            wrong = words;
        }
        interlock.acknowledge(trip);
    }
    over.store(true);
    shaker_thread.join();
    acquisition.join();
    EXPECT_EQ(wrong, "");
    EXPECT_TRUE(seen[0] > 0 && seen[1] > 0) << seen[0] << " " << seen[1];
}

TEST_F(InterlockTest, ASecondTripOfTheSameCauseIsNotAcknowledgedWithTheFirst) {
    interlock.guard(Guard::excitation);
    interlock.trip(Trip::loop_open);
    const auto first = interlock.latched();
    interlock.acknowledge(first);
    interlock.trip(Trip::loop_open);
    interlock.acknowledge(first);
    EXPECT_EQ(interlock.tripped(), Trip::loop_open);
}

/// The table's rows and nothing else; samples come at 40 Hz.
struct TableTest : testing::Test {
    RealClock clock;
    std::unique_ptr<drivers::Waiter> control = clock.make_waiter();
    FakeShaker shaker;
    std::unique_ptr<Interlock> interlock;
    drivers::Sample sample;
    drivers::PlatformStatus platform;
    bool thermometer = false;

    void make(std::vector<Rule> rules) {
        Interlock::Limits limits{
            12.0, drivers::kSecond, std::move(rules), {.sample_period = kPeriod}};
        limits.thermometer = thermometer;
        interlock = std::make_unique<Interlock>(shaker, *control, std::move(limits));
        sample.quality.fill(drivers::Quality::good);
        sample.force = {0, 1, 0};
        sample.time = 10 * drivers::kSecond;
        platform.loop_closed = true;
        platform.time = sample.time;
        interlock->guard(Guard::excitation);
    }
    void next() {
        sample.time += kPeriod;
        interlock->check(sample, platform);
    }
    /// Vibration of 6 g along a vertical and of 6 g * share across it.
    void vibrate(double seconds, const std::array<double, 3>& vertical,
                 const std::array<double, 3>& across, double share) {
        for (int n = 0; n < seconds * 40; ++n) {
            const double t = drivers::to_seconds(sample.time);
            const double a = 6 * std::sin(2 * std::numbers::pi * 15.3 * t);
            for (std::size_t i = 0; i < 3; ++i)
                sample.force[i] = vertical[i] * (1 + a) + across[i] * a * share;
            next();
        }
    }
    drivers::ShakerReading reading(double measured_g, double time_s) const {
        drivers::ShakerReading r;
        r.valid = r.running = true;
        r.state = drivers::kShakerRunning;
        r.measured_g = measured_g;
        r.time = drivers::from_seconds(time_s);
        return r;
    }
};

TEST_F(TableTest, AlarmsInTheInnerBandAndAbortsInTheOuterOneAfterItsDwell) {
    // GIVEN bands of 1 dB and 3 dB about 9 g, the outer one to be left for half a second
    make({{"warn", Trip::amplitude_off, Reaction::alarm, 1, 0, false},
          {"stop", Trip::amplitude_off, Reaction::abort, 3, 0.5, true}});
    interlock->command(9, {0, 0, 0});
    struct Step {
        double decibel, time_s;
        bool alarm;
        Trip trip;
    };
    for (const Step& step :
         {Step{0.9, 1.0, false, Trip::none}, Step{-1.1, 1.2, true, Trip::none},
          Step{0.0, 1.4, false, Trip::none}, Step{3.1, 1.6, true, Trip::none},
          Step{2.9, 1.8, true, Trip::none}, Step{-3.1, 2.0, true, Trip::none},
          Step{-3.1, 2.4, true, Trip::none}, Step{-3.1, 2.5, true, Trip::amplitude_off}}) {
        interlock->check(reading(9 * std::pow(10, step.decibel / 20), step.time_s));
        EXPECT_EQ(interlock->row(0).raised, step.alarm) << step.time_s;
        EXPECT_EQ(interlock->tripped(), step.trip) << step.time_s;
    }
    EXPECT_EQ(interlock->name_of(interlock->latched()), "stop");
    EXPECT_EQ(interlock->text_of(interlock->latched()), "amplitude off command: 3.1, limit 3 dB");
    EXPECT_EQ(shaker.stops_asked, 1U);
}

TEST_F(TableTest, TakesNoAmplitudeForOneThatIsOff) {
    make({{"stop", Trip::amplitude_off, Reaction::abort, 3, 0, true}});
    // on the way to the level nothing is commanded yet
    interlock->command(0, {0, 0, 0});
    interlock->check(reading(0.1, 1));
    EXPECT_EQ(interlock->tripped(), Trip::none);
    // no motion at all is infinitely far off
    interlock->command(9, {0, 0, 0});
    interlock->check(reading(0, 2));
    EXPECT_EQ(interlock->tripped(), Trip::amplitude_off);
}

TEST_F(TableTest, ATemperatureThatNoLongerComesIsNotBelieved) {
    make({{"hot", Trip::temperature, Reaction::abort, 90, 5, true}});
    platform.temperature_c = 40;
    platform.temperature_time = sample.time;
    const auto seconds = [this] { return drivers::to_seconds(sample.time); };
    const double last = seconds();
    while (seconds() < last + 60) {
        next();
        EXPECT_EQ(interlock->tripped(), Trip::none) << seconds();
    }
    while (seconds() < last + 65.2) next();
    ASSERT_EQ(interlock->tripped(), Trip::temperature);
    EXPECT_EQ(interlock->text_of(interlock->latched()),
              "platform temperature: not known, limit 90 degC");
}

TEST_F(TableTest, AThermometerThatNeverSpeaksIsNotBelievedOnceTheTableShakes) {
    // GIVEN one that is configured and has said nothing since the start
    thermometer = true;
    make({{"hot", Trip::temperature, Reaction::abort, 90, 5, true}});
    interlock->guard(Guard::armed);
    for (int n = 0; n < 10 * 40; ++n) next();
    EXPECT_EQ(interlock->tripped(), Trip::none) << "it may be late";
    interlock->guard(Guard::excitation);
    for (int n = 0; n < 4 * 40; ++n) next();
    EXPECT_EQ(interlock->tripped(), Trip::none) << "the row's dwell";
    for (int n = 0; n < 2 * 40; ++n) next();
    ASSERT_EQ(interlock->tripped(), Trip::temperature);
    EXPECT_EQ(interlock->text_of(interlock->latched()),
              "platform temperature: not known, limit 90 degC");
    // BUT where none is configured there is none to wait for
    thermometer = false;
    make({{"hot", Trip::temperature, Reaction::abort, 90, 5, true}});
    for (int n = 0; n < 10 * 40; ++n) next();
    EXPECT_EQ(interlock->tripped(), Trip::none);
}

TEST_F(TableTest, ALatchedAlarmStaysUntilItsNameIsAcknowledged) {
    make({{"hot", Trip::temperature, Reaction::alarm, 70, 0.1, true},
          {"warm", Trip::temperature, Reaction::alarm, 60, 0, false}});
    platform.temperature_c = 71;
    platform.temperature_time = sample.time;
    next();
    EXPECT_FALSE(interlock->row(0).raised) << "its dwell is not over";
    for (int n = 0; n < 5; ++n) next();
    EXPECT_TRUE(interlock->row(0).raised);
    EXPECT_EQ(interlock->row(0).value, 71);
    platform.temperature_c = 50;
    next();
    EXPECT_TRUE(interlock->row(0).raised);
    EXPECT_FALSE(interlock->row(1).raised) << "not latched";
    EXPECT_FALSE(interlock->acknowledge_alarm("hotter"));
    EXPECT_TRUE(interlock->acknowledge_alarm("hot"));
    EXPECT_FALSE(interlock->row(0).raised);
    EXPECT_EQ(shaker.stops_asked, 0U) << "alarm is not abort";
}

TEST_F(TableTest, MeasuresCrossAxisMotionAndTiltWhateverTheGimbalAngles) {
    // GIVEN a vertical that lies along no axis, and one across it
    const double s = std::sqrt(0.5);
    const std::array<double, 3> vertical{s, -s, 0}, across{s, s, 0};
    make({{"cross", Trip::cross_axis, Reaction::alarm, 0.3, 0, false},
          {"tilt", Trip::tilt, Reaction::abort, 5, 0, true}});
    interlock->command(9, {0, 0, 0});
    vibrate(10, vertical, across, 0.2);
    EXPECT_FALSE(interlock->row(0).raised);
    EXPECT_EQ(interlock->tripped(), Trip::none);
    // WHEN the share grows, THEN that is cross-axis motion and no tilt
    vibrate(10, vertical, across, 0.4);
    EXPECT_TRUE(interlock->row(0).raised);
    EXPECT_EQ(interlock->tripped(), Trip::none);
    // WHEN everything turns by 6 degrees, THEN that is tilt
    const double turn = 6 * std::numbers::pi / 180;
    std::array<double, 3> turned{};
    for (std::size_t i = 0; i < 3; ++i)
        turned[i] = vertical[i] * std::cos(turn) + across[i] * std::sin(turn);
    vibrate(10, turned, across, 0);
    EXPECT_EQ(interlock->tripped(), Trip::tilt);
}

TEST_F(TableTest, KnowsWhereTheGimbalsAreToBe) {
    make({{"gimbal", Trip::gimbal_off, Reaction::abort, 2, 0, true}});
    interlock->command(9, {-45, 0, 359.5});
    sample.angle = {315 * std::numbers::pi / 180, 0, 1.4 * std::numbers::pi / 180};
    next();
    EXPECT_EQ(interlock->tripped(), Trip::none) << "a turn more or less is the same place";
    sample.angle[2] = 1.6 * std::numbers::pi / 180;
    next();
    EXPECT_EQ(interlock->tripped(), Trip::gimbal_off);
}

TEST_F(TableTest, JudgesFilterAndDisk) {
    make({{"filter", Trip::filter_divergence, Reaction::alarm, 10, 0, false},
          {"disk", Trip::disk, Reaction::alarm, 200, 0, false}});
    next();
    EXPECT_FALSE(interlock->row(0).raised || interlock->row(1).raised) << "not known yet";
    interlock->filter(std::numeric_limits<double>::quiet_NaN());
    interlock->disk_free(199);
    next();
    EXPECT_TRUE(interlock->row(0).raised && interlock->row(1).raised);
    interlock->filter(1);
    interlock->disk_free(201);
    next();
    EXPECT_FALSE(interlock->row(0).raised || interlock->row(1).raised);
}

TEST(Losses, AreAShareOfTheSamplesDueOverTenSeconds) {
    LossMonitor loss;
    std::uint64_t samples = 0, incomplete = 0, gaps = 0;
    // GIVEN 40 samples a second, of which one never comes and one is incomplete
    for (int second = 0; second < 30; ++second) {
        loss.add(second * drivers::kSecond, samples, incomplete, gaps);
        samples += 39;
        incomplete += 1;
        gaps += 1;
    }
    EXPECT_NEAR(loss.percent(), 5, 1e-12);
    // THEN they are forgotten ten seconds after they cease
    for (int second = 30; second < 42; ++second) {
        loss.add(second * drivers::kSecond, samples, incomplete, gaps);
        samples += 40;
    }
    EXPECT_EQ(loss.percent(), 0);
}

TEST(Reaction, TheStopIsTheNextWriteAndNoSetPointFollows) {
    using drivers::test::Answer;
    // GIVEN a shaker on a real Modbus connection, commanded to run, and a poll that hangs
    drivers::test::TestServer server;
    RealClock clock;
    const auto control = clock.make_waiter();
    auto settings = drivers::test::settings_for(server);
    settings.response_timeout = 60 * drivers::kSecond;
    const auto shaker = drivers::make_shaker(clock, settings);
    Interlock interlock(*shaker, *control,
                        {.table_g = 12.0, .witness = {.sample_period = kPeriod}});
    shaker->on_reading([&] { control->notify(); });
    shaker->on_stop_written([&] { interlock.stop_written(); });
    shaker->start([] { return true; }, [](drivers::LinkState, const char*) {});
    const auto eventually = [&](const auto& done) {
        const auto deadline = clock.now() + 10 * drivers::kSecond;
        while (!done() && clock.now() < deadline) control->wait_until(clock.now() + 2'000'000);
        return done();
    };
    ASSERT_TRUE(eventually([&] { return shaker->state() == drivers::LinkState::running; }));
    const std::uint64_t armed = shaker->stops();
    ASSERT_TRUE(shaker->request({15.0, 1.0, 1.0}, armed));
    ASSERT_TRUE(eventually([&] { return !shaker->busy(); }));
    std::atomic<bool> hung = false;
    server.script([&](const drivers::test::Request& request) {
        return request.connection == 1 && (hung.exchange(true) || true)
                   ? Answer{Answer::Kind::hang, 0, {}}
                   : Answer{};
    });
    ASSERT_TRUE(eventually([&] { return hung.load(); }));
    server.forget();
    // WHEN a sample trips the interlock, and the control thread asks for more right then
    interlock.guard(Guard::excitation);
    drivers::Sample sample;
    sample.quality.fill(drivers::Quality::good);
    sample.table_accel = 13;
    drivers::PlatformStatus platform;
    platform.loop_closed = true;
    interlock.arrived(clock.now());
    interlock.check(sample, platform);
    EXPECT_FALSE(shaker->request({15.0, 2.0, 1.0}, armed));
    // THEN the stop is the first write, nothing but the watchdog follows, even once the stop is
    // confirmed, and its time is known
    ASSERT_TRUE(eventually([&] { return !shaker->stop_pending(); }));
    EXPECT_FALSE(shaker->request({15.0, 2.0, 1.0}, armed));
    const std::uint64_t polls = shaker->counters().requests;
    ASSERT_TRUE(eventually([&] { return shaker->counters().requests > polls + 5; }));
    const auto writes = server.writes();
    ASSERT_FALSE(writes.empty());
    EXPECT_TRUE(writes.front().writes(drivers::test::kRun, 0));
    EXPECT_EQ(drivers::test::addresses_written(server), std::vector{drivers::test::kRun});
    const auto reactions = interlock.reactions();
    std::uint64_t measured = 0;
    for (const auto count : reactions.count) measured += count;
    EXPECT_EQ(measured, 1U);
    EXPECT_GT(reactions.largest_ms, 0);
    shaker->shut_down();
}

}  // namespace
}  // namespace vibrig::rt
