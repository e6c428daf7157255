#include "tests/plant/faults.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

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
