#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <initializer_list>
#include <numbers>

#include "tests/plant/shaker_controller.hpp"
#include "tests/plant/shared_rig.hpp"

namespace vibrig::plant {
namespace {

using Answer = ShakerController::Answer;
constexpr double kStep = 0.025;

void write(ShakerController& shaker, std::size_t address,
           std::initializer_list<std::uint16_t> values) {
    EXPECT_EQ(shaker.write(address, std::span(values.begin(), values.size())), Answer::accepted);
}
void wait(ShakerController& shaker, double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += kStep) shaker.advance(kStep);
}
/// So many seconds with a watchdog that is fed twice a second.
void feed(ShakerController& shaker, double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += 0.5) {
        write(shaker, 6, {static_cast<std::uint16_t>(shaker.holding()[6] + 1)});
        wait(shaker, 0.5);
    }
}
double measured_g(const ShakerController& shaker) {
    return 1e-4 * ((shaker.input()[3] << 16) | shaker.input()[4]);
}

constexpr std::uint16_t kIdle = 0, kRamping = 1, kRunning = 2, kFault = 4;

/// A shaker with a watchdog of 1 s that was commanded to do 5 g, ramp 0.5 s, and was fed for 2 s.
ShakerController shaking(const ShakerLies& lies) {
    ShakerController shaker(20, 25);
    shaker.lie(lies);
    write(shaker, 2, {0, 50000, 50, 1});
    write(shaker, 7, {1000});
    feed(shaker, 2);
    return shaker;
}

TEST(ShakerLies, NoLieIsTheHonestController) {
    ShakerController shaker = shaking({});
    EXPECT_EQ(shaker.amplitude_g(), 5);
    EXPECT_EQ(measured_g(shaker), 5);
    write(shaker, 5, {0});
    wait(shaker, 0.5);
    EXPECT_TRUE(shaker.at_rest());
}

TEST(ShakerLies, AStopAcknowledgedAndNotDoneIsSeenInTheMeasuredAmplitudeAndEndedByTheWatchdog) {
    // GIVEN a table that shakes
    ShakerController shaker = shaking({.ack_without_stop = true});
    // WHEN it is stopped and fed on
    write(shaker, 5, {0});
    EXPECT_EQ(shaker.holding()[5], 0) << "read back as stopped";
    feed(shaker, 10);
    // THEN it shakes on and its registers but the one of run say so
    EXPECT_EQ(shaker.amplitude_g(), 5);
    EXPECT_EQ(measured_g(shaker), 5);
    EXPECT_EQ(shaker.input()[0], kRunning);
    // WHEN nobody feeds it any more THEN its watchdog stops it
    wait(shaker, 1.6);
    EXPECT_TRUE(shaker.at_rest());
    EXPECT_EQ(shaker.faults(), kFaultWatchdog);
}

TEST(ShakerLies, AStopThatWasOnlyAcknowledgedIsDoneWhenTheLieEnds) {
    ShakerController shaker = shaking({.ack_without_stop = true});
    write(shaker, 5, {0});
    shaker.lie({});
    wait(shaker, 0.5);
    EXPECT_TRUE(shaker.at_rest());
    EXPECT_EQ(shaker.input()[0], kIdle);
}

TEST(ShakerLies, TheWatchdogCountsOnlyWithOrWithoutALink) {
    for (const bool linked : {true, false}) {
        ShakerLies lies;
        (linked ? lies.timeout_if_linked : lies.timeout_if_unlinked) = true;
        ShakerController shaker = shaking({});
        shaker.lie(lies);
        shaker.linked(!linked);
        wait(shaker, 10);
        EXPECT_EQ(shaker.input()[0], kRunning) << linked;
        shaker.linked(linked);
        wait(shaker, 1.6);
        EXPECT_EQ(shaker.input()[0], kFault) << linked;
    }
}

TEST(ShakerLies, TheChainCutsNothingIsNotShownOrStartsAnew) {
    ShakerController contact = shaking({.estop_contact_only = true});
    contact.open_emergency_stop(true);
    feed(contact, 2);
    EXPECT_EQ(contact.amplitude_g(), 5);
    EXPECT_EQ(contact.input()[2], 1);

    ShakerController unseen = shaking({.estop_unseen = true});
    unseen.open_emergency_stop(true);
    wait(unseen, 0.2);
    EXPECT_TRUE(unseen.at_rest());
    EXPECT_EQ(unseen.input()[2], 0);

    ShakerController eager = shaking({.estop_restarts = true});
    eager.open_emergency_stop(true);
    wait(eager, 0.2);
    EXPECT_TRUE(eager.at_rest());
    eager.open_emergency_stop(false);
    feed(eager, 1);
    EXPECT_EQ(eager.amplitude_g(), 5);
    EXPECT_EQ(eager.holding()[5], 1);
}

TEST(ShakerLies, TheWatchdogNeverFiresOrLate) {
    ShakerController never = shaking({.timeout_ignored = true});
    wait(never, 100);
    EXPECT_EQ(never.amplitude_g(), 5);
    EXPECT_EQ(never.holding()[7], 1000);

    ShakerController late = shaking({.timeout_scaled = 10});
    wait(late, 9.4);  // fed half a second ago
    EXPECT_EQ(late.amplitude_g(), 5);
    EXPECT_EQ(late.holding()[7], 1000) << "the register tells nothing";
    wait(late, 1);
    EXPECT_TRUE(late.at_rest());
}

TEST(ShakerLies, AnotherMasterKeepsItsTimeoutInTheRegisterWhichObeysIt) {
    ShakerController off = shaking({.timeout_register = 0});
    EXPECT_EQ(off.holding()[7], 0) << "what was written is gone";
    wait(off, 100);
    EXPECT_EQ(off.amplitude_g(), 5);

    // In a running table it changes under the daemon's hands, and stays so.
    ShakerController longer = shaking({});
    longer.lie({.timeout_register = 7000});
    EXPECT_EQ(longer.holding()[7], 7000);
    write(longer, 7, {1000});
    EXPECT_EQ(longer.holding()[7], 7000);
    wait(longer, 6.4);
    EXPECT_EQ(longer.amplitude_g(), 5);
    wait(longer, 1);
    EXPECT_TRUE(longer.at_rest());
}

TEST(ShakerLies, AScaledTableAgreesWithItsRegistersAndDoesMore) {
    ShakerController shaker = shaking({.amplitude_scaled = 2});
    EXPECT_EQ(measured_g(shaker), 5);
    EXPECT_EQ(shaker.set_point_g(), 5);
    EXPECT_EQ(shaker.amplitude_g(), 10);
    // The limit switch is on the table: 15 g at 15 Hz are 16.6 mm, 30 g 33 mm.
    write(shaker, 2, {2, 18928});
    feed(shaker, 1);
    EXPECT_EQ(shaker.faults(), kFaultLimit);
}

TEST(ShakerLies, OtherUnitsAreFactorsOfRootTwoAndOfGravity) {
    ShakerController shaker = shaking({.unit_rms = true});
    EXPECT_EQ(measured_g(shaker), 5);
    EXPECT_NEAR(shaker.amplitude_g(), 5 * std::numbers::sqrt2, 1e-12);
    shaker.lie({.unit_mps2 = true});
    EXPECT_EQ(measured_g(shaker), 5);
    EXPECT_NEAR(shaker.amplitude_g(), 5 / 9.80665, 1e-12);
}

TEST(ShakerLies, AnEchoHidesADeadTable) {
    ShakerController dead = shaking({.dead_table = true});
    EXPECT_TRUE(dead.at_rest());
    EXPECT_EQ(measured_g(dead), 0);
    EXPECT_EQ(dead.input()[0], kRunning);

    ShakerController echo = shaking({.readback_echo = true, .dead_table = true});
    EXPECT_TRUE(echo.at_rest());
    EXPECT_EQ(measured_g(echo), 5);
    write(echo, 5, {0});
    EXPECT_EQ(measured_g(echo), 0);
    // The echo knows of no ramp.
    wait(echo, 1);
    write(echo, 5, {1});
    EXPECT_EQ(measured_g(echo), 5);
    EXPECT_EQ(echo.input()[0], kRamping);
}

TEST(ShakerLies, AStuckContactorShakesOnUnderAControllerThatBelievesItselfAtRest) {
    // GIVEN a table that shakes; WHEN it is stopped
    ShakerController shaker = shaking({.stuck_contactor = true});
    write(shaker, 5, {0});
    feed(shaker, 5);
    // THEN every register says it is at rest, and nothing moves less
    EXPECT_EQ(shaker.input()[0], kIdle);
    EXPECT_EQ(measured_g(shaker), 0);
    EXPECT_EQ(shaker.faults(), 0);
    EXPECT_EQ(shaker.amplitude_g(), 5);
    // AND no watchdog helps, only the emergency stop
    wait(shaker, 100);
    EXPECT_EQ(shaker.amplitude_g(), 5);
    shaker.open_emergency_stop(true);
    wait(shaker, 0.05);
    EXPECT_TRUE(shaker.at_rest());

    // A trip of the watchdog is no better.
    ShakerController starved = shaking({.stuck_contactor = true});
    wait(starved, 5);
    EXPECT_EQ(starved.input()[0], kFault);
    EXPECT_EQ(measured_g(starved), 0);
    EXPECT_EQ(starved.amplitude_g(), 5);
}

TEST(ShakerLies, ASlowRampIsSlowUpAndDownButNotForTheEmergencyStop) {
    // GIVEN ramps of 0.5 s that take ten times that
    ShakerController shaker(20, 25);
    shaker.lie({.slow_ramp = 10});
    write(shaker, 2, {0, 50000, 50, 1});
    wait(shaker, 2.5);
    EXPECT_NEAR(shaker.amplitude_g(), 2.5, 1e-9);
    EXPECT_EQ(shaker.input()[0], kRamping);
    wait(shaker, 2.5);
    EXPECT_EQ(shaker.input()[0], kRunning);
    write(shaker, 5, {0});
    wait(shaker, 2.5);
    EXPECT_NEAR(shaker.amplitude_g(), 2.5, 1e-9);
    EXPECT_NEAR(measured_g(shaker), 2.5, 1e-4);
    shaker.open_emergency_stop(true);
    wait(shaker, 0.05);
    EXPECT_TRUE(shaker.at_rest());
}

TEST(ShakerLies, AFaultOfTheControllerIsLatchedUntilAcknowledged) {
    ShakerController shaker = shaking({});
    shaker.lie({.latched_fault = true});
    wait(shaker, 1);
    EXPECT_EQ(shaker.input()[0], kFault);
    EXPECT_EQ(shaker.faults(), kFaultInternal);
    EXPECT_TRUE(shaker.at_rest());
    shaker.lie({});
    EXPECT_EQ(shaker.faults(), kFaultInternal);
    write(shaker, 5, {0});
    EXPECT_EQ(shaker.faults(), 0);
    EXPECT_EQ(shaker.input()[0], kIdle);
}

TEST(ShakerLies, BeginAndEndAsTheFaultsSay) {
    // GIVEN a rig whose table does double from the start, and a fault of three times from 1 to 2 s
    Truth truth;
    truth.shaker_lies.amplitude_scaled = 2;
    SharedRig shared(truth);
    shared.faults.add(parse_fault("amplitude_scaled=3@1..2", 0));
    shared.faults.add(parse_fault("latched_fault@2..2.1", 0));
    const std::array<std::uint16_t, 4> start{0, 20000, 1, 1};  // 2 g
    ASSERT_EQ(shared.rig.shaker().write(2, start), Answer::accepted);
    const auto at = [&](double time_s) {
        while (shared.now_s() < time_s - 1e-9) {
            shared.apply_faults();
            shared.rig.advance();
        }
        return shared.rig.shaker().amplitude_g();
    };
    EXPECT_EQ(at(0.5), 4);
    EXPECT_EQ(at(1.5), 6);
    EXPECT_EQ(at(2), 6);
    at(2.05);
    EXPECT_EQ(shared.rig.shaker().faults(), kFaultInternal);
    EXPECT_EQ(at(3), 0);
}

TEST(ShakerLies, ShakeTheAccelerometersNotTheRegisters) {
    // GIVEN no noise, 2 g ordered of a table that does double
    Truth truth;
    truth.table_accelerometer_g = 0;
    truth.shaker_lies.amplitude_scaled = 2;
    Rig rig(truth);
    const std::array<std::uint16_t, 4> start{0, 20000, 1, 1};
    ASSERT_EQ(rig.shaker().write(2, start), Answer::accepted);
    for (int i = 0; i < 200; ++i) rig.advance();
    // WHEN 8 samples are squared, which are 3 periods of 15 Hz THEN the rms is that of 4 g
    double square = 0;
    for (int i = 0; i < 8; ++i) {
        rig.advance();
        square += rig.readings().table_g * rig.readings().table_g / 8;
    }
    EXPECT_NEAR(square, 8, 1e-9);
    EXPECT_NEAR(measured_g(rig.shaker()), 2, 1e-9);
}

}  // namespace
}  // namespace vibrig::plant
