#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "tests/plant/control.hpp"
#include "tests/plant/faults.hpp"
#include "tests/plant/shared_rig.hpp"

namespace vibrig::plant {
namespace {

std::vector<can_frame> numbered(std::size_t count) {
    std::vector<can_frame> frames(count);
    for (std::size_t i = 0; i < count; ++i) {
        frames[i].can_id = static_cast<canid_t>(i);
        frames[i].len = 8;
    }
    return frames;
}

std::string complaint(const char* spec) {
    try {
        static_cast<void>(parse_fault(spec, 0));
    } catch (const PlantError& error) {
        return error.what();
    }
    return "none";
}

TEST(FaultSpec, ReadsNameChannelValueAndTimes) {
    Fault fault = parse_fault("lose=0.01@100..200", 5);
    EXPECT_EQ(fault.kind, FaultKind::lose);
    EXPECT_EQ(fault.value, 0.01);
    EXPECT_EQ(fault.from_s, 100);
    EXPECT_EQ(fault.to_s, 200);
    fault = parse_fault("stuck:inner", 5);
    EXPECT_EQ(fault.channel, 1U);
    EXPECT_EQ(fault.from_s, 5);
    EXPECT_TRUE(std::isinf(fault.to_s));
    fault = parse_fault("spike:azimuth=0.5,0.001@10", 0);
    EXPECT_EQ(fault.channel, 2U);
    EXPECT_EQ(fault.value, 0.5);
    EXPECT_EQ(fault.rate, 0.001);
    fault = parse_fault("bus-silent=3", 7);
    EXPECT_EQ(fault.to_s, 10);
    EXPECT_EQ(parse_fault("lose:0.25", 0).value, 0.25);
    EXPECT_EQ(parse_fault("nan:x", 0).kind, FaultKind::out_of_range);
    EXPECT_EQ(parse_fault("gyro-noise=8", 0).value, 8);
    fault = parse_fault("sync_growth=4,25.1@30", 0);
    EXPECT_EQ(fault.kind, FaultKind::sync_growth);
    EXPECT_EQ(fault.value, 4);
    EXPECT_EQ(fault.hz, 25.1);
    EXPECT_EQ(fault.from_s, 30);
    EXPECT_TRUE(fault.at(25.1));
    EXPECT_FALSE(fault.at(15));
    EXPECT_TRUE(parse_fault("cross-growth=4", 0).at(15));
    EXPECT_EQ(parse_fault("distorted=0.2,65.1", 0).hz, 65.1);
    EXPECT_EQ(parse_fault("ack_without_stop@3", 0).kind, FaultKind::ack_without_stop);
    EXPECT_EQ(parse_fault("timeout-register=0", 0).value, 0);
}

TEST(FaultSpec, SaysWhatIsWrong) {
    const auto expect = [](const char* spec, const char* part) {
        EXPECT_NE(complaint(spec).find(part), std::string::npos) << complaint(spec);
        EXPECT_NE(complaint(spec).find(spec), std::string::npos) << complaint(spec);
    };
    expect("", "unknown fault");
    expect("loose=1", "unknown fault \"loose\"");
    expect("lose", "no value");
    expect("sync-growth=4,often", "expected a frequency from 0.1 to 2000 Hz");
    expect("distorted=0.7", "expected a share from 0 to 0.5");
    expect("lose=2", "rate from 0 to 1");
    expect("lose=nan", "rate from 0 to 1");
    expect("lose=", "rate from 0 to 1");
    expect("gyro-noise=-1", "a factor from 0 to 1000");
    expect("lose=0.1,0.2", "expected one value");
    expect("lose:outer=0.1", "expected none");
    expect("stuck:alpha", "outer, inner, azimuth");
    expect("stuck=1", "takes no value");
    expect("spike:x=1", "outer, inner or azimuth");
    expect("lose=0.1@", "a time");
    expect("lose=0.1@5..", "a time");
    expect("lose=0.1@200..100", "after the first");
    expect("modbus-wrong=maybe", "exception or value");
    expect("stuck-contactor=1", "takes no value");
    expect("amplitude_scaled", "no value");
    expect("slow_ramp=0.5", "a factor from 1 to 1000");
    expect("timeout_register=0.5", "a whole number from 0 to 65535");
    expect("timeout_register=65536", "a whole number from 0 to 65535");
    expect("timeout_register", "no value");
}

TEST(Faults, LoseTheShareAskedForAndNothingOutsideTheirTime) {
    SCOPED_TRACE("seed 9");
    Faults faults(9);
    faults.add(parse_fault("lose=0.1@10..20", 0));
    const std::size_t n = 10000;
    std::vector<can_frame> frames = numbered(n);
    faults.spoil(frames, 9.9);
    EXPECT_EQ(frames.size(), n);
    faults.spoil(frames, 10);
    const double expected = 0.1 * n;
    EXPECT_NEAR(static_cast<double>(n - frames.size()), expected, 4 * std::sqrt(expected));
    EXPECT_EQ(faults.lost(), n - frames.size());
    frames = numbered(n);
    faults.spoil(frames, 20);
    EXPECT_EQ(frames.size(), n);
}

TEST(Faults, DelayDoubleSwapAndCutFrames) {
    Faults faults(1);
    faults.add(parse_fault("late=60@0..0.01", 0));
    std::vector<can_frame> frames = numbered(3);
    faults.spoil(frames, 0);
    EXPECT_TRUE(frames.empty());
    frames = numbered(1);
    faults.spoil(frames, 0.05);
    EXPECT_EQ(frames.size(), 1U);
    frames = numbered(1);
    faults.spoil(frames, 0.075);
    EXPECT_EQ(frames.size(), 4U);  // the three late ones first

    faults.add(parse_fault("duplicate=1", 1));
    frames = numbered(2);
    faults.spoil(frames, 1);
    ASSERT_EQ(frames.size(), 4U);
    EXPECT_EQ(frames[1].can_id, 0U);
    faults.clear("duplicate");

    faults.add(parse_fault("reorder=1", 2));
    frames = numbered(3);
    faults.spoil(frames, 2);
    EXPECT_EQ(frames[0].can_id, 1U);
    EXPECT_EQ(frames[2].can_id, 0U);
    faults.clear();

    faults.add(parse_fault("shorten=1", 3));
    frames = numbered(1);
    faults.spoil(frames, 3);
    EXPECT_EQ(frames[0].len, 3);
    faults.clear();

    faults.add(parse_fault("bus-silent=1", 4));
    frames = numbered(5);
    faults.spoil(frames, 4.5);
    EXPECT_TRUE(frames.empty());
    EXPECT_THROW(faults.clear("nonsense"), PlantError);
}

TEST(Faults, SpoilOnlyTheirChannel) {
    Faults faults(1);
    Sample sample;
    sample.readings.encoder_deg = {10, 20, 30};
    sample.readings.raw_g = {0.1, 0.2, 0.3};
    faults.spoil(sample, 0);
    faults.add(parse_fault("stuck:outer", 1));
    faults.add(parse_fault("flag:y", 1));
    faults.add(parse_fault("out-of-range:z", 1));
    faults.add(parse_fault("spike:azimuth=0.5,1", 1));
    Sample later;
    later.readings.encoder_deg = {11, 21, 31};
    later.readings.raw_g = {0.4, 0.5, 0.6};
    faults.spoil(later, 1);
    EXPECT_EQ(later.readings.encoder_deg[0], 10);
    EXPECT_EQ(later.readings.encoder_deg[1], 21);
    EXPECT_NEAR(later.readings.encoder_deg[2], 31.5, 2e-4);
    EXPECT_EQ(later.readings.raw_g[0], 0.4);
    EXPECT_GT(later.readings.raw_g[2], 32);
    EXPECT_TRUE(later.valid[3]);
    EXPECT_FALSE(later.valid[4]);
}

TEST(Control, ExecutesLinesAndComplains) {
    SharedRig shared{Truth{}};
    Control control(shared);
    EXPECT_EQ(control.execute("fault lose=0.5"), "ok fault lose=0.5");
    EXPECT_NE(shared.faults.active(FaultKind::lose, 0), nullptr);
    EXPECT_EQ(control.execute("  clear lose\r"), "ok clear lose");
    EXPECT_EQ(shared.faults.active(FaultKind::lose, 0), nullptr);
    EXPECT_EQ(control.execute("table 2.5"), "ok table 2.5");
    EXPECT_EQ(shared.rig.shaker().amplitude_g(), 2.5);
    EXPECT_EQ(control.execute("table own"), "ok table own");
    EXPECT_EQ(shared.rig.shaker().amplitude_g(), 0);
    EXPECT_EQ(control.execute("estop open"), "ok estop open");
    EXPECT_TRUE(shared.emergency_stop_by_hand);
    EXPECT_EQ(control.execute("status").substr(0, 7), "ok time");
    for (const char* line : {"", "estop", "fault", "fault nonsense", "clear everything", "quit now",
                             "table", "table -1", "table nan", "table 2 g"}) {
        EXPECT_EQ(control.execute(line).substr(0, 6), "error:") << line;
    }
}

/// Motion of the encoders about the azimuth axis and of the vibration to the north, peak.
struct InStepOf {
    double encoder_arcsec = 0, across_g = 0, second_g = 0;
};
InStepOf shaken(const char* spec, std::uint16_t hz) {
    Truth truth;
    truth.hard = true;
    truth.resolver_arcsec = truth.accelerometer_g = truth.gyro_random_walk_deg_per_rt_h = 0;
    truth.platform_rocking_arcsec_g = {0, 40, 0};
    truth.cross_axis = {0.03, 0};
    SharedRig shared(truth);
    if (*spec != '\0') shared.faults.add(parse_fault(spec, 0));
    shared.rig.slew_to({0, 0, 0});
    const std::array<std::uint16_t, 6> words{
        0, static_cast<std::uint16_t>(hz * 1000), 0, 10000, 100, 1};
    EXPECT_EQ(shared.rig.shaker().write(0, words), ShakerController::Answer::accepted);
    for (int i = 0; i < 1200; ++i) {
        shared.apply_faults();
        shared.rig.advance();
        if (i == 400) shared.rig.release();
    }
    // Least squares of a line and a sine would know better; a mean square of differences does here.
    InStepOf out;
    constexpr int kReadings = 400;
    const double turn = 2 * 3.14159265358979 * hz * 0.025;
    double c = 0, s = 0, last = shared.rig.readings().encoder_deg[1], ac = 0, as = 0, bc = 0,
           bs = 0;
    for (int i = 0; i < kReadings; ++i) {
        shared.apply_faults();
        shared.rig.advance();
        const auto& seen = shared.rig.readings();
        const double step = std::remainder(seen.encoder_deg[1] - last, 360) * 3600;
        last = seen.encoder_deg[1];
        const double x = std::cos(turn * i), y = std::sin(turn * i);
        c += step * x;
        s += step * y;
        ac += seen.raw_g[0] * x;
        as += seen.raw_g[0] * y;
        bc += seen.raw_g[1] * std::cos(2 * turn * i);
        bs += seen.raw_g[1] * std::sin(2 * turn * i);
    }
    out.encoder_arcsec = 2 * std::hypot(c, s) / kReadings / (2 * std::abs(std::sin(turn / 2)));
    out.across_g = 2 * std::hypot(ac, as) / kReadings;
    out.second_g = 2 * std::hypot(bc, bs) / kReadings;
    return out;
}

TEST(FaultGrowth, IsOfItsKindAndAtItsFrequency) {
    // 400 readings at 40/s hold whole periods of 13 Hz, and of twice that.
    const auto honest = shaken("", 13);
    EXPECT_NEAR(honest.encoder_arcsec, 40, 1);
    EXPECT_NEAR(honest.across_g, 0.03, 1e-3);
    EXPECT_NEAR(honest.second_g, 0, 1e-3);
    const auto rocks = shaken("sync-growth=4,13", 13);
    EXPECT_NEAR(rocks.encoder_arcsec, 160, 4);
    EXPECT_NEAR(rocks.across_g, 0.03, 1e-3);
    EXPECT_NEAR(shaken("sync-growth=4,17", 13).encoder_arcsec, 40, 1);
    EXPECT_NEAR(shaken("sync-growth=4@100", 13).encoder_arcsec, 40, 1) << "not before its time";
    const auto across = shaken("cross-growth=4", 13);
    EXPECT_NEAR(across.across_g, 0.12, 2e-3);
    EXPECT_NEAR(across.encoder_arcsec, 40, 1);
    EXPECT_NEAR(shaken("distorted=0.2,13", 13).second_g, 0.2, 5e-3);
    EXPECT_NEAR(shaken("distorted=0.2,17", 13).second_g, 0, 1e-3);
}

}  // namespace
}  // namespace vibrig::plant
