#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "tests/plant/faults.hpp"
#include "tests/plant/random_drive.hpp"
#include "tests/plant/shared_rig.hpp"

// Random vibration of the simulated rig: what its controller shows, and what the table does.
namespace vibrig::plant {
namespace {

using Answer = ShakerController::Answer;

ShakerProfile flat(std::uint16_t number, double from, double to, double rms) {
    const double density = rms * rms / (to - from);
    return {number, {{from, density}, {to, density}}};
}
Truth rig_with_profiles() {
    Truth truth;
    truth.hard = true;
    truth.profiles = {flat(1, 20, 200, 2), flat(2, 50, 60, 1)};
    return truth;
}
std::uint32_t joined(const ShakerController& shaker, std::size_t at) {
    const auto input = shaker.input();
    return std::uint32_t{input[at]} << 16 | input[at + 1];
}
double measured_rms(const ShakerController& shaker) {
    return 1e-4 * joined(shaker, ShakerController::kMeasuredRms);
}
std::uint16_t state_of(const ShakerController& shaker) {
    return shaker.input()[ShakerController::kControlState];
}
Answer put_words(ShakerController& shaker, std::size_t at, std::vector<std::uint16_t> words) {
    return shaker.write(at, words);
}
/// Profile 1 at a level in dB, with a ramp of 1 s.
void start(ShakerController& shaker, double level_db) {
    ASSERT_EQ(put_words(shaker, ShakerController::kProfileNumber,
                        {1, std::bit_cast<std::uint16_t>(
                                static_cast<std::int16_t>(std::lround(10 * level_db)))}),
              Answer::accepted);
    ASSERT_EQ(put_words(shaker, ShakerController::kMode, {1}), Answer::accepted);
    ASSERT_EQ(put_words(shaker, 4, {100, 1}), Answer::accepted);
}

TEST(RandomVibration, ProfileHasPowerDisplacementAndChecksum) {
    // Values of docs/theory/spectrum.md: the truck's rms, and its displacement over 3.
    const ShakerProfile truck{1, {{10, 0.015}, {40, 0.015}, {500, 0.00015}}};
    EXPECT_NEAR(truck.rms_g(), 1.042917, 1e-6);
    EXPECT_NEAR(3 * truck.rms_mm(), 1.66, 0.01);
    // By zlib.crc32(struct.pack(">6f", 10, 0.015, 40, 0.015, 500, 0.00015)).
    EXPECT_EQ(truck.checksum(), 0x245D2C08U);
    const ShakerProfile fall{2, {{20, 0.04}, {40, 0.02}}};  // f^-1: its integral is a logarithm
    EXPECT_NEAR(fall.power(20, 40), 0.8 * std::numbers::ln2, 1e-9);
}

TEST(RandomVibration, DriveIsStationaryGaussianAndOfTheProfilesShape) {
    // GIVEN a drive of a profile with two plateaus, sampled at 8 kHz for 200 s
    constexpr double kStep = 1.0 / 8000;
    ShakerProfile profile{1, {{20, 0.01}, {100, 0.01}, {101, 0.04}, {200, 0.04}}};
    RandomDrive drive(7, kStep);
    drive.shape(profile);
    std::vector<Shake> shakes(200 * 8000);
    drive.next(shakes);
    // WHEN moments are taken THEN they are those of a Gaussian of rms 1, within four standard
    // errors: 1 / sqrt(B_e T) of the mean square, B_e = 131 Hz.
    double second = 0, fourth = 0, ahead = 0, mixed = 0;
    for (const Shake& s : shakes) {
        second += s.in_phase * s.in_phase;
        fourth += std::pow(s.in_phase, 4);
        ahead += s.quadrature * s.quadrature;
        mixed += s.in_phase * s.quadrature;
    }
    const double n = static_cast<double>(shakes.size()), stray = 1 / std::sqrt(131.0 * 200);
    EXPECT_NEAR(second / n, 1, 4 * stray);
    EXPECT_NEAR(ahead / n, 1, 4 * stray);
    EXPECT_NEAR(mixed / n, 0, 4 * stray);
    // Four times as many hertz in the square: 3 with sd sqrt(96 / (2 B T)) at most.
    EXPECT_NEAR(fourth / n, 3, 4 * std::sqrt(96 / (2 * 131.0 * 200)));
    // AND the power up to 100 Hz is the profile's share, by a filter of its own: the mean of the
    // lines' power over blocks of 1 s, of which 80 of 180 lines are there.
    double low = 0, all = 0;
    for (std::size_t block = 0; block < 40; ++block) {
        for (int hz = 15; hz <= 205; ++hz) {
            std::complex<double> sum = 0;
            for (std::size_t i = 0; i < 8000; i += 4)
                sum += shakes[8000 * block + i].in_phase *
                       std::polar(1.0, -2 * std::numbers::pi * hz * kStep * static_cast<double>(i));
            (hz <= 100 ? low : all) += std::norm(sum);
        }
    }
    const double share = profile.power(0, 100.5) / profile.power(0, 1000);
    // 40 blocks of about 80 lines for the smaller part.
    EXPECT_NEAR(low / (low + all), share, 4 * share / std::sqrt(40.0 * 80) + 0.01);
}

TEST(RandomVibration, ControllerLevelsUpAndShowsProfileLevelAndBands) {
    Rig rig(rig_with_profiles());
    ShakerController& shaker = rig.shaker();
    const auto run_for = [&](double s) {
        for (double t = 0; t < s - 1e-9; t += 0.025) rig.advance();
    };
    EXPECT_EQ(state_of(shaker), 0);
    start(shaker, -6);
    EXPECT_EQ(joined(shaker, ShakerController::kProfileChecksum),
              rig.truth().profiles[0].checksum());
    EXPECT_EQ(state_of(shaker), 1 | kBandsArmed);
    run_for(1);
    EXPECT_EQ(state_of(shaker), 2 | kBandsArmed);
    EXPECT_NEAR(shaker.amplitude_g(), 2 * std::pow(10, -0.3), 1e-9);
    // What chooses the vibration is refused while it moves.
    EXPECT_EQ(put_words(shaker, ShakerController::kMode, {0}), Answer::illegal_value);
    EXPECT_EQ(put_words(shaker, ShakerController::kProfileNumber, {2}), Answer::illegal_value);
    EXPECT_EQ(put_words(shaker, ShakerController::kProfileLevel, {0}), Answer::illegal_value);
    // A mean over 1 s of 180 Hz strays by 5 % in the square.
    run_for(5);
    EXPECT_NEAR(measured_rms(shaker), shaker.amplitude_g(), 0.12 * shaker.amplitude_g());
    // A stop is at once, whatever the ramp.
    ASSERT_EQ(put_words(shaker, 4, {1000, 0}), Answer::accepted);
    run_for(0.05);
    EXPECT_TRUE(shaker.at_rest());
    EXPECT_EQ(shaker.state(), ShakerState::idle);
    // And a sine is a sine again.
    ASSERT_EQ(put_words(shaker, ShakerController::kMode, {0}), Answer::accepted);
    EXPECT_EQ(state_of(shaker), 0);
    EXPECT_EQ(put_words(shaker, 2, {0, 50000, 10, 1}), Answer::accepted);
    run_for(1);
    EXPECT_EQ(shaker.amplitude_g(), 5);
}

/// The block of what was measured: Hz, g^2/Hz, without what is not used.
std::vector<std::array<double, 2>> psd_of(const ShakerController& shaker) {
    std::vector<std::array<double, 2>> pairs;
    for (std::size_t i = 0; i < ShakerController::kPsdPairs; ++i) {
        const std::size_t at = ShakerController::kPsdBlock + 4 * i;
        const double hz = std::bit_cast<float>(joined(shaker, at));
        if (hz == 0) break;
        pairs.push_back({hz, std::bit_cast<float>(joined(shaker, at + 2))});
    }
    return pairs;
}
/// After 20 s of profile 1 at -6 dB.
ShakerController played(Truth truth) {
    Rig rig(truth);
    start(rig.shaker(), -6);
    for (int i = 0; i < 40 * 20; ++i) rig.advance();
    EXPECT_TRUE(psd_of(rig.shaker()).empty()) << "it is of a vibration that is over";
    EXPECT_EQ(put_words(rig.shaker(), 4, {0, 0}), Answer::accepted);
    for (int i = 0; i < 4; ++i) rig.advance();
    return rig.shaker();
}
double mean_square(const std::vector<std::array<double, 2>>& psd) {
    double sum = 0;
    for (std::size_t i = 1; i < psd.size(); ++i)
        sum += (psd[i][0] - psd[i - 1][0]) * (psd[i][1] + psd[i - 1][1]) / 2;
    return sum;
}
double between(const std::vector<std::array<double, 2>>& psd, double from, double to) {
    double sum = 0, count = 0;
    for (const auto& [hz, density] : psd) {
        if (hz < from || hz > to) continue;
        sum += density;
        ++count;
    }
    return sum / count;
}

TEST(RandomVibration, ControllerTellsThePsdThatWasPlayed) {
    const auto psd = psd_of(played(rig_with_profiles()));
    ASSERT_GT(psd.size(), 20U);
    EXPECT_EQ(psd.front()[0], 20);
    EXPECT_EQ(psd.back()[0], 200);
    EXPECT_TRUE(std::ranges::is_sorted(psd));
    // 180 Hz over 19 s know their mean square to 1.7 %; of two frames laid over one another less.
    EXPECT_NEAR(mean_square(psd), 4 * std::pow(10, -0.6), 4 * 0.024 * 4 * std::pow(10, -0.6));
}

TEST(RandomVibration, AProfileThatIsTiltedIsMeasuredSo) {
    Truth truth = rig_with_profiles();
    truth.shaker_lies.profile_tilted = 3;
    const auto psd = psd_of(played(truth));
    // Two octaves: 6 dB; 20 Hz over 19 s know either to 5 %.
    EXPECT_NEAR(between(psd, 150, 170) / between(psd, 37, 43), std::pow(10, 0.6), 4 * 0.12 * 4);
    EXPECT_NEAR(mean_square(psd), 4 * std::pow(10, -0.6), 4 * 0.03 * 4 * std::pow(10, -0.6));
}

TEST(RandomVibration, APsdThatIsStaleStaysWhatItWas) {
    ShakerController shaker = played(rig_with_profiles());
    const auto before = psd_of(shaker);
    ShakerLies lies;
    lies.psd_stale = true;
    lies.psd_scaled = 1.5;
    shaker.lie(lies);
    const std::vector<double> other(300, 0.01);
    shaker.measured(other, 1);
    ASSERT_EQ(psd_of(shaker).size(), before.size());
    EXPECT_FLOAT_EQ(static_cast<float>(psd_of(shaker)[5][1]),
                    static_cast<float>(1.5 * before[5][1]));
    lies.psd_nan = true;
    shaker.lie(lies);
    EXPECT_TRUE(std::ranges::any_of(psd_of(shaker), [](auto& p) { return std::isnan(p[1]); }));
}

TEST(RandomVibration, UnknownProfilesModesAndLevelsAreRefused) {
    Rig rig(rig_with_profiles());
    ShakerController& shaker = rig.shaker();
    EXPECT_EQ(put_words(shaker, ShakerController::kProfileNumber, {3}), Answer::illegal_value);
    EXPECT_EQ(put_words(shaker, ShakerController::kMode, {1}),
              Answer::illegal_value);  // of no profile
    EXPECT_EQ(put_words(shaker, ShakerController::kMode, {2}), Answer::illegal_value);
    EXPECT_EQ(put_words(shaker, ShakerController::kProfileLevel, {61}), Answer::illegal_value);
    EXPECT_EQ(put_words(shaker, ShakerController::kProfileLevel, {1}), Answer::accepted);
}

TEST(RandomVibration, BandsAbortWhenAnotherShakesTheTable) {
    for (const bool bands : {true, false}) {
        Truth truth = rig_with_profiles();
        truth.shaker_lies.no_abort_bands = !bands;
        Rig rig(truth);
        start(rig.shaker(), 0);
        for (int i = 0; i < 240; ++i) rig.advance();
        EXPECT_EQ(state_of(rig.shaker()), bands ? 2 | kBandsArmed : 2);
        rig.shaker().drive_from_outside(4.0);
        for (int i = 0; i < 80; ++i) rig.advance();
        EXPECT_EQ(rig.shaker().state(), bands ? ShakerState::fault : ShakerState::running);
        EXPECT_EQ(state_of(rig.shaker()), bands ? 3 | kBandsArmed | kAbortAbove << 8 : 2);
    }
}

TEST(RandomVibration, FaultsLoadAnotherProfileOrDoAnotherLevel) {
    SharedRig shared(rig_with_profiles());
    shared.faults.add(parse_fault("wrong_profile=2", 0));
    shared.faults.add(parse_fault("profile_level_wrong=6", 0));
    shared.apply_faults();
    ShakerController& shaker = shared.rig.shaker();
    start(shaker, 0);
    for (int i = 0; i < 400; ++i) shared.rig.advance();
    // Number and level read back as written, the checksum is the loaded one's.
    EXPECT_EQ(shaker.holding()[ShakerController::kProfileNumber], 1);
    EXPECT_EQ(joined(shaker, ShakerController::kProfileChecksum),
              shared.rig.truth().profiles[1].checksum());
    // 6 dB over the loaded profile's, which is what is measured (10 Hz: 32 % in the square).
    EXPECT_NEAR(shaker.amplitude_g(), std::pow(10, 0.3), 1e-9);
    EXPECT_NEAR(measured_rms(shaker), 1, 0.5);
    EXPECT_THROW(static_cast<void>(parse_fault("profile_level_wrong=21", 0)), PlantError);
    EXPECT_THROW(static_cast<void>(parse_fault("wrong_profile", 0)), PlantError);
}

TEST(RandomVibration, PlatformHasTheProfileThroughItsPads) {
    // Flat 20 to 200 Hz through pads of 9.18 Hz: mean square by the transfer function.
    Truth truth = rig_with_profiles();
    truth.hard = false;
    truth.accelerometer_g = 0;
    Rig rig(truth);
    const Isolator pads(truth.transmission, truth.frequency_hz, truth.damping, 1e-3);
    double expected = 0;
    for (double hz = 20.05; hz < 200; hz += 0.1)
        expected += 0.1 * 4.0 / 180 * std::norm(pads.transfer(hz));
    start(rig.shaker(), 0);
    for (int i = 0; i < 200; ++i) rig.advance();
    double sum = 0;
    constexpr int kSamples = 12000;
    for (int i = 0; i < kSamples; ++i) {
        rig.advance();
        const Vec3 f = rig.readings().raw_g;
        sum += std::pow(f[1] - 1, 2);
    }
    // Slow samples are independent: sqrt(2 / n).
    EXPECT_NEAR(sum / kSamples / expected, 1, 5 * std::sqrt(2.0 / kSamples));
}

}  // namespace
}  // namespace vibrig::plant
