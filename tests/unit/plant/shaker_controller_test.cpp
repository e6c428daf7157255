#include "tests/plant/shaker_controller.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace vibrig::plant {
namespace {

using Answer = ShakerController::Answer;
constexpr double kTick = 0.025;

Answer write(ShakerController& shaker, std::size_t address, std::vector<std::uint16_t> values) {
    return shaker.write(address, values);
}
void run_for(ShakerController& shaker, double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += kTick) shaker.advance(kTick);
}
ShakerController started(double ramp_s = 2) {
    ShakerController shaker(20, 25);
    EXPECT_EQ(write(shaker, 2, {1, 24464, static_cast<std::uint16_t>(ramp_s * 100), 1}),
              Answer::accepted);  // 9 g
    return shaker;
}

TEST(ShakerController, RampsFromZeroAndRuns) {
    // GIVEN a start to 9 g over 2 s
    ShakerController shaker = started();
    EXPECT_EQ(shaker.state(), ShakerState::ramping);
    // WHEN half the ramp has passed THEN half the amplitude is there
    run_for(shaker, 1);
    EXPECT_NEAR(shaker.amplitude_g(), 4.5, 1e-9);
    EXPECT_EQ(shaker.state(), ShakerState::ramping);
    run_for(shaker, 1);
    EXPECT_EQ(shaker.state(), ShakerState::running);
    EXPECT_EQ(shaker.amplitude_g(), 9);
    EXPECT_EQ(shaker.input()[3], 1);
    EXPECT_EQ(shaker.input()[4], 24464);
}

TEST(ShakerController, AmplitudeChangeRampsAndStopRampsDown) {
    ShakerController shaker = started();
    run_for(shaker, 2);
    // WHEN 7 g are asked for while running THEN it ramps there
    EXPECT_EQ(write(shaker, 2, {1, 4464}), Answer::accepted);
    EXPECT_EQ(shaker.state(), ShakerState::ramping);
    run_for(shaker, 1);
    EXPECT_NEAR(shaker.amplitude_g(), 8, 1e-9);
    run_for(shaker, 1);
    EXPECT_EQ(shaker.state(), ShakerState::running);
    // WHEN stopped THEN it ramps down and is idle at rest
    EXPECT_EQ(write(shaker, 5, {0}), Answer::accepted);
    EXPECT_EQ(shaker.state(), ShakerState::stopping);
    run_for(shaker, 1);
    EXPECT_NEAR(shaker.amplitude_g(), 3.5, 1e-9);
    run_for(shaker, 1);
    EXPECT_EQ(shaker.state(), ShakerState::idle);
    EXPECT_TRUE(shaker.at_rest());
}

TEST(ShakerController, RefusesAFrequencyWhileMoving) {
    ShakerController shaker = started();
    run_for(shaker, 0.5);
    EXPECT_EQ(write(shaker, 0, {0, 20000}), Answer::illegal_value);
    EXPECT_EQ(shaker.frequency_hz(), 15);
    // The frequency in force may be part of a block.
    EXPECT_EQ(write(shaker, 0, {0, 15000, 1, 24464}), Answer::accepted);
    // A refused block changes nothing at all.
    EXPECT_EQ(write(shaker, 0, {0, 20000, 0, 100}), Answer::illegal_value);
    EXPECT_EQ(shaker.set_point_g(), 9);
    // At rest it may change.
    EXPECT_EQ(write(shaker, 5, {0}), Answer::accepted);
    run_for(shaker, 2);
    EXPECT_EQ(write(shaker, 0, {0, 20000}), Answer::accepted);
    EXPECT_EQ(shaker.frequency_hz(), 20);
}

TEST(ShakerController, RefusesAddressesAndValuesItDoesNotHave) {
    ShakerController shaker(20, 25);
    EXPECT_EQ(write(shaker, 16, {0}), Answer::illegal_address);
    EXPECT_EQ(write(shaker, 15, {0, 0}), Answer::illegal_address);
    EXPECT_EQ(write(shaker, 0, {}), Answer::illegal_address);
    EXPECT_EQ(write(shaker, 2, {0xffff, 0xffff}), Answer::illegal_value);
    EXPECT_EQ(write(shaker, 0, {0, 0}), Answer::illegal_value);
    EXPECT_EQ(write(shaker, 5, {2}), Answer::illegal_value);
}

TEST(ShakerController, SweepsOnceItsLevelIsThere) {
    // GIVEN a sweep from 20 to 80 Hz, two octaves at 2 a minute, and a ramp of 1 s to 1 g
    ShakerController shaker(20, 25);
    const auto hz = [&] {
        const auto input = shaker.input();
        return 1e-3 * (input[ShakerController::kActualFrequency] * 65536.0 +
                       input[ShakerController::kActualFrequency + 1]);
    };
    EXPECT_EQ(write(shaker, ShakerController::kMode, {2}), Answer::illegal_value)
        << "from and to are not there";
    EXPECT_EQ(write(shaker, 11, {0, 20000, 1, 14464, 200}), Answer::accepted);
    EXPECT_EQ(write(shaker, ShakerController::kMode, {2}), Answer::accepted);
    EXPECT_EQ(write(shaker, 2, {0, 10000, 100, 1}), Answer::accepted);
    // THEN it waits for its level and 5 s more
    run_for(shaker, 1 + 5 - 0.1);
    EXPECT_NEAR(hz(), 20, 1e-9);
    // AND goes up exponentially, whatever else is written
    run_for(shaker, 0.1 + 30);
    EXPECT_NEAR(hz(), 40, 0.1);
    EXPECT_EQ(write(shaker, 6, {1}), Answer::accepted);
    EXPECT_NEAR(shaker.table_hz(), 40, 0.1);
    EXPECT_EQ(write(shaker, 11, {0, 30000}), Answer::illegal_value) << "it moves";
    // AND stays at its end
    run_for(shaker, 40);
    EXPECT_NEAR(hz(), 80, 1e-9);
    EXPECT_EQ(shaker.amplitude_g(), 1);
    // AND down again where from is above to
    EXPECT_EQ(write(shaker, 5, {0}), Answer::accepted);
    run_for(shaker, 2);
    EXPECT_EQ(write(shaker, 11, {1, 14464, 0, 20000, 200}), Answer::accepted);
    EXPECT_EQ(write(shaker, 5, {1}), Answer::accepted);
    run_for(shaker, 1 + 5 + 30);
    EXPECT_NEAR(hz(), 40, 0.1);
}

TEST(ShakerController, WatchdogStopsAShakerThatNobodyFeeds) {
    // GIVEN a running shaker with a watchdog of 1 s, fed for 3 s
    ShakerController shaker = started(0.1);
    EXPECT_EQ(write(shaker, 7, {1000}), Answer::accepted);
    for (std::uint16_t i = 1; i <= 6; ++i) {
        EXPECT_EQ(write(shaker, 6, {i}), Answer::accepted);
        run_for(shaker, 0.5);
    }
    EXPECT_EQ(shaker.state(), ShakerState::running);
    // WHEN the same value is written again THEN that is no food: fault, and at rest within half a
    // second
    EXPECT_EQ(write(shaker, 6, {6}), Answer::accepted);
    run_for(shaker, 0.6);
    EXPECT_EQ(shaker.state(), ShakerState::fault);
    EXPECT_EQ(shaker.faults(), kFaultWatchdog);
    run_for(shaker, 0.5);
    EXPECT_TRUE(shaker.at_rest());
    EXPECT_EQ(shaker.holding()[5], 0);
    // AND it does not start before the fault is acknowledged by run = 0 at rest
    EXPECT_EQ(write(shaker, 5, {1}), Answer::illegal_value);
    EXPECT_EQ(write(shaker, 5, {0}), Answer::accepted);
    EXPECT_EQ(shaker.state(), ShakerState::idle);
    EXPECT_EQ(shaker.faults(), 0);
    EXPECT_EQ(write(shaker, 5, {1}), Answer::accepted);
}

TEST(ShakerController, WatchdogIsQuietAtRest) {
    ShakerController shaker(20, 25);
    EXPECT_EQ(write(shaker, 7, {100}), Answer::accepted);
    run_for(shaker, 5);
    EXPECT_EQ(shaker.state(), ShakerState::idle);
}

TEST(ShakerController, EmergencyStopCutsThePower) {
    ShakerController shaker = started(0.1);
    run_for(shaker, 1);
    // WHEN the chain opens THEN the table is at rest within 50 ms and stays latched
    shaker.open_emergency_stop(true);
    run_for(shaker, 0.05);
    EXPECT_TRUE(shaker.at_rest());
    EXPECT_EQ(shaker.input()[0], 4);
    EXPECT_EQ(shaker.input()[1], kFaultEmergencyStop);
    EXPECT_EQ(shaker.input()[2], 1);
    EXPECT_EQ(write(shaker, 5, {0}), Answer::accepted);
    EXPECT_EQ(shaker.state(), ShakerState::fault);  // the chain is still open
    shaker.open_emergency_stop(false);
    EXPECT_EQ(shaker.state(), ShakerState::fault);
    EXPECT_EQ(write(shaker, 5, {0}), Answer::accepted);
    EXPECT_EQ(shaker.state(), ShakerState::idle);
}

TEST(ShakerController, LimitSwitchTripsOnTooLongAStroke) {
    // GIVEN 2 Hz, where 1 g is 62 mm
    ShakerController shaker(20, 25);
    EXPECT_EQ(write(shaker, 0, {0, 2000, 0, 10000, 100, 1}), Answer::accepted);
    run_for(shaker, 1);
    EXPECT_EQ(shaker.state(), ShakerState::fault);
    EXPECT_EQ(shaker.faults(), kFaultLimit);
}

}  // namespace
}  // namespace vibrig::plant
