// Every condition of the table: not at its limit, only beyond it and for its dwell time, only while
// it is watched, latched, acknowledged.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/interlock/interlock.hpp"
#include "daemon/rt/real_clock.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"
#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::rt {
namespace {

using drivers::kSecond;
using drivers::Time;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kDwell_s = 0.5;
constexpr double kTable_g = 12;
constexpr double kCommanded_g = 9;

/// A rig on which all is well until a test changes something; 40 samples a second.
struct Rig {
    RealClock clock;
    std::unique_ptr<drivers::Waiter> control = clock.make_waiter();
    FakeShaker shaker;
    drivers::SampleAssembler assembler{test::rig_dbc(), test::rig_settings(),
                                       [](const drivers::Sample&) {}};
    drivers::Sample sample;
    drivers::PlatformStatus platform;
    std::unique_ptr<Interlock> interlock;
    std::uint32_t count = 0;
    std::function<bool(const char* message)> sent = [](const char*) { return true; };

    explicit Rig(std::vector<Rule> rules) {
        interlock =
            std::make_unique<Interlock>(shaker, *control,
                                        Interlock::Limits{kTable_g,
                                                          500 * drivers::kMillisecond,
                                                          std::move(rules),
                                                          {.frequency_hz = 15.3,
                                                           .sample_period = test::kPeriod,
                                                           .count_g = {1e-4, 1e-4, 1e-4, 1e-4}},
                                                          1,
                                                          {{40, 100, 100}}});
        sample.quality.fill(drivers::Quality::good);
        sample.force = {0, 1, 0};
        platform.loop_closed = true;
        shaker.now.valid = true;
        shaker.now.measured_g = kCommanded_g;
        interlock->command(kCommanded_g, {0, 0, 0});
        interlock->ramp({.start_g = kCommanded_g,
                         .target_g = kCommanded_g,
                         .armed_g = kCommanded_g,
                         .raw_up = {0, 1, 0}});
    }

    /// At 15.3 Hz: table, and platform along y.
    void vibrate(double table_g, double platform_g) {
        const double a = std::sin(2 * std::numbers::pi * 15.3 * seconds());
        sample.table_accel = table_g * a;
        sample.force = {0, 1 + platform_g * a, 0};
    }

    [[nodiscard]] double seconds() const { return drivers::to_seconds(count * test::kPeriod); }
    void feed(const drivers::ReceivedFrame& frame, const char* message) {
        if (sent(message)) assembler.feed(frame);
    }
    /// What comes within 25 ms, judged where the daemon judges it.
    void tick() {
        const Time now = ++count * test::kPeriod + kSecond;
        const auto frames = test::frames_of_count(count, now);
        constexpr std::array names{
            "Sync",           "Resolvers",         "ResolverAzimuth", "AccelerometersXY",
            "AccelerometerZ", "TableAccelerometer"};
        for (std::size_t i = 0; i < names.size(); ++i) feed(frames[i], names[i]);
        feed(test::frame_of(test::rig_dbc(), "PlatformStatus", now, {{"LoopClosed", 1}}),
             "PlatformStatus");
        assembler.advance(now);
        sample.time = platform.time = platform.temperature_time = shaker.now.time = now;
        interlock->check(sample, platform);
        interlock->check_ages(assembler, now);
        interlock->check(shaker.now);
    }
};

struct Case {
    const char* name;
    Trip trip;
    double limit;
    /// Before each tick: the condition just within its limit, or just beyond.
    std::function<void(Rig&, bool beyond)> set;
    Guard watched = Guard::excitation;  ///< lowest level at which it must trip
    Guard unwatched = Guard::armed;     ///< at which it must not; == watched: none
    double dwell_s = kDwell_s;          ///< 0: an event, wrong for one judgement only
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

/// A message comes once in `beyond` counts, or else in `within`.
std::function<void(Rig&, bool)> rare(std::string message, std::uint32_t within,
                                     std::uint32_t beyond) {
    return [=](Rig& rig, bool wrong) {
        rig.sent = [&rig, message, every = wrong ? beyond : within](const char* name) {
            return name != message || rig.count % every == 0;
        };
    };
}

constexpr std::uint32_t kNotAtAll = 1'000'000'000;

const Case kCases[] = {
    // 100 ms and 500 ms are the ages that are still good
    {"stale_channel", Trip::stale_channel, 0, rare("AccelerometerZ", 5, kNotAtAll)},
    {"stale_table_accelerometer", Trip::stale_channel, 0, rare("TableAccelerometer", 5, kNotAtAll)},
    {"stale_platform", Trip::stale_platform, 0, rare("PlatformStatus", 21, kNotAtAll),
     // longer than it takes until the next one
     Guard::excitation, Guard::armed, 1},
    {"loop_open", Trip::loop_open, 0,
     [](Rig& rig, bool beyond) { rig.platform.loop_closed = !beyond; }},
    {"platform_fault", Trip::platform_fault, 0,
     [](Rig& rig, bool beyond) { rig.platform.fault = beyond; }},
    {"over_amplitude_of_the_table", Trip::over_amplitude, 0,
     [](Rig& rig, bool beyond) { rig.sample.table_accel = beyond ? -12.001 : -kTable_g; }},
    {"over_amplitude_of_the_shaker", Trip::over_amplitude, 0,
     [](Rig& rig, bool beyond) { rig.shaker.now.measured_g = beyond ? 12.001 : kTable_g; },
     Guard::armed, Guard::idle},
    {"emergency_stop", Trip::emergency_stop, 0,
     [](Rig& rig, bool beyond) { rig.shaker.now.emergency_stop_open = beyond; }, Guard::armed,
     Guard::idle},
    {"shaker_fault", Trip::shaker_fault, 0,
     [](Rig& rig, bool beyond) { rig.shaker.now.fault = beyond ? 2 : 0; }, Guard::armed,
     Guard::idle},
    {"shaker_fault_state", Trip::shaker_fault, 0,
     [](Rig& rig, bool beyond) {
         rig.shaker.now.state = beyond ? drivers::kShakerFault : drivers::kShakerRunning;
     },
     Guard::armed, Guard::idle},
    {"uncommanded", Trip::uncommanded, 0,
     [](Rig& rig, bool beyond) { rig.shaker.now.running = beyond; }, Guard::idle,
     Guard::excitation},
    {"can_lost", Trip::can_lost, 0,
     [](Rig& rig, bool beyond) {
         if (beyond) rig.interlock->lost_bus();
     },
     Guard::armed, Guard::idle, 0},
    {"amplitude_low", Trip::amplitude_off, 3,
     [](Rig& rig, bool beyond) {
         rig.shaker.now.measured_g = kCommanded_g * std::pow(10, (beyond ? -3.01 : -2.99) / 20);
     },
     Guard::armed, Guard::idle},
    {"amplitude_high", Trip::amplitude_off, 3,
     [](Rig& rig, bool beyond) {
         rig.shaker.now.measured_g = kCommanded_g * std::pow(10, (beyond ? 3.01 : 2.99) / 20);
     },
     Guard::armed, Guard::idle},
    {"frame_loss", Trip::frame_loss, 10,
     [](Rig& rig, bool beyond) {
         // one sample in ten is incomplete, or one in eight
         rig.sent = [&rig, every = beyond ? 8U : 10U](const char* name) {
             return std::string_view(name) != "ResolverAzimuth" || rig.count % every != 0;
         };
     },
     // looked at once a second, over ten: a breach is seen for that long
     Guard::excitation, Guard::armed, 15},
    {"frame_loss_of_flagged_readings", Trip::frame_loss, 10,
     [](Rig& rig, bool beyond) {
         rig.sent = [&rig, every = beyond ? 8U : 10U](const char* name) {
             if (std::string_view(name) != "AccelerometersXY" || rig.count % every != 0)
                 return true;
             rig.assembler.feed(test::frame_of(test::rig_dbc(), name,
                                               rig.count * test::kPeriod + kSecond,
                                               {{"X", 0}, {"SyncLow", rig.count % 256}}));
             return false;
         };
     },
     Guard::excitation, Guard::armed, 15},
    {"gimbal_not_in_position", Trip::gimbal_off, 2,
     [](Rig& rig, bool beyond) { rig.sample.angle[1] = (beyond ? -2.01 : -1.99) * kDegree; }},
    {"cross_axis_motion", Trip::cross_axis, 0.3,
     [](Rig& rig, bool beyond) {
         const double a = 6 * std::sin(2 * std::numbers::pi * 15.3 * rig.seconds());
         rig.sample.force = {0, 1 + a, a * (beyond ? 0.32 : 0.28)};
     }},
    {"tilt", Trip::tilt, 5,
     [](Rig& rig, bool beyond) {
         // since the excitation began, which was level
         const double tilt = rig.seconds() < 6 ? 0 : (beyond ? 5.2 : 4.9) * kDegree;
         rig.sample.force = {std::sin(tilt), std::cos(tilt), 0};
     }},
    {"temperature", Trip::temperature, 70,
     [](Rig& rig, bool beyond) { rig.platform.temperature_c = beyond ? 70.1 : 69.9; }, Guard::idle,
     Guard::idle},
    {"filter_divergence", Trip::filter_divergence, 10,
     [](Rig& rig, bool beyond) { rig.interlock->filter(beyond ? 10.01 : 9.99); }},
    {"read_back_mismatch", Trip::read_back, 0,
     [](Rig& rig, bool beyond) {
         if (beyond) ++rig.shaker.counts.read_back_mismatches;
     },
     Guard::armed, Guard::idle, 0},
    {"shaker_link_lost", Trip::shaker_lost, 0,
     [](Rig& rig, bool beyond) { rig.shaker.now.valid = !beyond; }, Guard::armed, Guard::idle},
    {"disk", Trip::disk, 200,
     [](Rig& rig, bool beyond) { rig.interlock->disk_free(beyond ? 199.9 : 200); }, Guard::idle,
     Guard::idle},
    {"recording_degraded", Trip::recording, 0,
     [](Rig& rig, bool beyond) { rig.interlock->onlookers(beyond, false); }, Guard::idle,
     Guard::idle},
    {"amplitude_witness", Trip::amplitude_witness, 0,
     [](Rig& rig, bool beyond) { rig.vibrate(kCommanded_g, beyond ? 8 : 8.1); }},
    {"over_armed_level", Trip::over_armed, 0,
     [](Rig& rig, bool beyond) { rig.vibrate(beyond ? 10.2 : 10, kCommanded_g); }},
    {"stuck", Trip::stuck, 0,
     [](Rig& rig, bool beyond) {
         const double was = rig.sample.table_accel;
         rig.vibrate(kCommanded_g, kCommanded_g);
         if (beyond) rig.sample.table_accel = was;
     }},
    {"stop_disobeyed", Trip::stop_disobeyed, 0,
     [](Rig& rig, bool beyond) { rig.interlock->stop_disobeyed(beyond); }, Guard::idle, Guard::idle,
     0},
    {"wrong_vibration", Trip::wrong_vibration, 0,
     [](Rig& rig, bool beyond) { rig.interlock->wrong_vibration(beyond); }, Guard::excitation,
     Guard::excitation, 0},
    {"motion_in_step", Trip::motion_in_step, 3,
     [](Rig& rig, bool beyond) { rig.interlock->growth(beyond ? 3.01 : 3, 1); }, Guard::excitation,
     Guard::excitation, 0},
    {"cross_axis_growth", Trip::cross_growth, 3,
     [](Rig& rig, bool beyond) { rig.interlock->growth(1, beyond ? 3.01 : 3); }, Guard::excitation,
     Guard::excitation, 0},
    {"abort_bands", Trip::abort_bands, 0,
     [](Rig& rig, bool beyond) {
         rig.shaker.now.running = true;
         rig.shaker.now.random = {.random = true, .bands_armed = !beyond};
     }},
    {"watchdog_changed", Trip::watchdog_changed, 0,
     [](Rig& rig, bool beyond) {
         rig.shaker.now.watchdog =
             beyond ? drivers::WatchdogTimeout::changed : drivers::WatchdogTimeout::kept;
     },
     Guard::armed, Guard::idle},
    {"guard_lost", Trip::guard_lost, 0,
     [](Rig& rig, bool beyond) { rig.interlock->outside(beyond, false, false); }, Guard::armed,
     Guard::idle},
    {"guard_stop", Trip::guard_stop, 0,
     [](Rig& rig, bool beyond) { rig.interlock->outside(false, beyond, false); }, Guard::idle,
     Guard::idle},
    {"annunciator_silent", Trip::horn, 0,
     [](Rig& rig, bool beyond) { rig.interlock->outside(false, false, beyond); }, Guard::idle,
     Guard::idle},
    {"server_stuck", Trip::server, 0,
     [](Rig& rig, bool beyond) { rig.interlock->onlookers(false, beyond); }, Guard::idle,
     Guard::idle},
};

class InterlockLimits : public testing::TestWithParam<Case> {
  protected:
    const Case& one = GetParam();
    /// One row that tells at once, one that stops after its dwell.
    Rig rig{{{"raised", one.trip, Reaction::alarm, one.limit, 0, false},
             {"stop", one.trip, Reaction::abort, one.limit, one.dwell_s, true}}};

    InterlockLimits() {
        for (int n = 0; n < 10; ++n) rig.tick();  // everything has been there once
    }
    void one_tick(bool beyond) {
        one.set(rig, beyond);
        rig.tick();
    }
    void go(bool beyond, int seconds) {
        for (int n = 0; n < 40 * seconds; ++n) one_tick(beyond);
    }
    [[nodiscard]] bool raised() const { return rig.interlock->row(0).raised; }
};

TEST_P(InterlockLimits, TripsBeyondItsLimitAfterItsDwellAndLatches) {
    rig.interlock->guard(one.watched);
    // GIVEN a condition at its limit WHEN it stays there THEN nothing is raised
    go(false, 20);
    ASSERT_FALSE(raised());
    ASSERT_EQ(rig.interlock->tripped(), Trip::none);
    // WHEN it is beyond THEN the stop comes as soon as the dwell is over, and no sooner
    std::uint32_t since = 0;
    const std::uint32_t end = rig.count + 40 * 60;
    while (rig.interlock->tripped() == Trip::none && rig.count < end) {
        one_tick(true);
        if (!raised()) {
            since = 0;
        } else if (since == 0) {
            since = rig.count;
        }
    }
    ASSERT_EQ(rig.interlock->tripped(), one.trip);
    EXPECT_EQ(rig.count - since, static_cast<std::uint32_t>(one.dwell_s * 40));
    EXPECT_EQ(rig.interlock->name_of(rig.interlock->latched()), "stop");
    EXPECT_EQ(rig.shaker.stops_asked, 1U);
    // WHEN all is well again THEN it stays, until it is acknowledged
    go(false, 20);
    EXPECT_EQ(rig.interlock->tripped(), one.trip);
    EXPECT_TRUE(rig.interlock->row(1).raised);
    EXPECT_EQ(rig.shaker.stops_asked, 1U);
    rig.interlock->acknowledge(rig.interlock->latched());
    go(false, 5);
    EXPECT_EQ(rig.interlock->tripped(), Trip::none);
    EXPECT_FALSE(rig.interlock->row(1).raised);
}

TEST_P(InterlockLimits, TakesTimeBeyondTheLimitTogetherOnlyWhenItIsWithoutABreak) {
    if (one.dwell_s == 0) return;  // of events each one counts
    rig.interlock->guard(one.watched);
    go(false, 20);
    // WHEN it is beyond again and again for less than the dwell, THEN nothing is stopped
    for (int n = 0; n < 5; ++n) {
        for (int wait = 0; wait < 40 * 20 && !raised(); ++wait) one_tick(true);
        ASSERT_TRUE(raised()) << n;
        for (int wait = 0; wait < 40 * 20 && raised(); ++wait) {
            one_tick(false);
            if (rig.interlock->tripped() != Trip::none) break;
        }
        ASSERT_FALSE(raised()) << n;
    }
    EXPECT_EQ(rig.interlock->tripped(), Trip::none);
    EXPECT_EQ(rig.shaker.stops_asked, 0U);
}

TEST_P(InterlockLimits, IsNotWatchedBelowItsLevel) {
    if (one.unwatched == one.watched) return;  // at every level
    rig.interlock->guard(one.unwatched);
    go(false, 10);
    go(true, 10);
    EXPECT_EQ(rig.interlock->tripped(), Trip::none);
    EXPECT_FALSE(raised());
    EXPECT_EQ(rig.shaker.stops_asked, 0U);
}

INSTANTIATE_TEST_SUITE_P(Every, InterlockLimits, testing::ValuesIn(kCases),
                         [](const auto& given) { return std::string(given.param.name); });

TEST(InterlockTable, GrowthIsAnAlarmUntilTheDwellIsOver) {
    Rig rig(default_interlock());
    rig.interlock->guard(Guard::excitation);
    const auto raised = [&] {
        std::vector<std::string> names;
        for (std::size_t i = 0; i < rig.interlock->rows(); ++i)
            if (const auto row = rig.interlock->row(i); row.raised) names.push_back(row.rule->name);
        return names;
    };
    EXPECT_EQ(rig.interlock->least_limit(Trip::motion_in_step), 3);
    EXPECT_TRUE(std::isinf(rig.interlock->least_limit(Trip::none)));
    rig.interlock->growth(4, 1);
    EXPECT_EQ(raised(), std::vector<std::string>{"motion_in_step"});
    rig.interlock->growth(1, 4);
    EXPECT_EQ(raised(), std::vector<std::string>{"cross_axis_growth"});
    EXPECT_EQ(rig.interlock->tripped(), Trip::none) << "the dwell goes on";
    rig.interlock->no_growth();
    EXPECT_TRUE(raised().empty());
    for (std::size_t i = 0; i < rig.interlock->rows(); ++i) {
        if (rig.interlock->row(i).rule->name != "motion_in_step") continue;
        EXPECT_TRUE(std::isnan(rig.interlock->row(i).present)) << "not looked for";
    }
}

TEST(InterlockTable, UnderRandomVibrationTooFewReadingsAreAWitnessThatKnowsNothing) {
    Rig rig(default_interlock());
    rig.interlock->guard(Guard::excitation);
    rig.interlock->ramp({.start_g = kCommanded_g,
                         .target_g = kCommanded_g,
                         .armed_g = kCommanded_g,
                         .raw_up = {0, 1, 0},
                         .random = 1});
    std::mt19937 random(1);
    std::normal_distribution<double> level(0, kCommanded_g);
    const auto shake = [&](double seconds, unsigned good_of) {
        const std::uint32_t end = rig.count + static_cast<std::uint32_t>(seconds * 40);
        while (rig.count < end && rig.interlock->tripped() == Trip::none) {
            const double a = level(random);
            rig.sample.force = {0, 1 + a, 0};
            rig.sample.table_accel = std::clamp(a, -12.0, 12.0);
            rig.sample.quality[4] =
                rig.count % good_of == 0 ? drivers::Quality::good : drivers::Quality::out_of_range;
            rig.tick();
        }
    };
    shake(20, 1);
    ASSERT_EQ(rig.interlock->tripped(), Trip::none)
        << rig.interlock->text_of(rig.interlock->latched());
    const std::uint32_t from = rig.count;
    shake(5, 4);
    EXPECT_EQ(rig.interlock->tripped(), Trip::amplitude_witness);
    EXPECT_LE(rig.count - from, 0.8 * 40);
    EXPECT_NE(rig.interlock->text_of(rig.interlock->latched()).find("platform does not know"),
              std::string::npos);
}

TEST(InterlockTable, AllConditionsAreTried) {
    for (const Condition& condition : kConditions) {
        if (condition.trip == Trip::none) continue;
        EXPECT_TRUE(std::ranges::any_of(kCases, [&](const Case& one) {
            return one.trip == condition.trip;
        })) << condition.name;
    }
}

}  // namespace
}  // namespace vibrig::rt
