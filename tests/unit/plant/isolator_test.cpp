#include "tests/plant/isolator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <random>
#include <vector>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {
namespace {

constexpr double kPi = std::numbers::pi;

// Answer over the table's drive, from a whole number of periods after the transient.
std::complex<double> measured(Isolator& isolator, double frequency, double step,
                              double harmonic = 1) {
    const int settle = static_cast<int>(std::lround(4 / step));
    const int count = static_cast<int>(std::lround(1 / step));
    std::complex<double> out = 0;
    std::complex<double> in = 0;
    for (int i = 0; i < settle + count; ++i) {
        isolator.advance(9);
        if (i < settle) continue;
        const std::complex<double> turn =
            std::polar(1.0, -2 * kPi * harmonic * frequency * i * step);
        out += isolator.platform_g() * turn;
        in += isolator.table_g(9) * turn;
    }
    return out / in;
}

TEST(Isolator, TransmitsTwoThirdsWithTheCorrectedPhase) {
    // GIVEN pads with zeta 0.2 that transmit 2/3 at 15 Hz
    Isolator isolator(2.0 / 3, 15, 0.2, 0.5e-3);
    isolator.set_drive(15, {});
    // WHEN the table vibrates at 15 Hz
    const std::complex<double> t = measured(isolator, 15, 0.5e-3);
    // THEN amplitude and phase are those of eq. 3 and the corrected eq. 4 (mass 1, k2 = 0)
    const double w = 2 * kPi * 15;
    const double w0 = 2 * kPi * isolator.natural_frequency_hz();
    const double k0 = w0 * w0;
    const double k1 = 2 * 0.2 * w0;
    const double big1 = k0 - w * w;
    EXPECT_NEAR(std::abs(t), 2.0 / 3, 1e-9);
    EXPECT_NEAR(std::arg(t), std::atan2(k1 * w, k0) - std::atan2(k1 * w, big1), 1e-9);
    EXPECT_NEAR(std::abs(std::sqrt((k0 * k0 + k1 * k1 * w * w) / (big1 * big1 + k1 * k1 * w * w))),
                2.0 / 3, 1e-12);
    EXPECT_LT(std::arg(t), -2);
    EXPECT_GT(isolator.natural_frequency_hz(), 7);
    EXPECT_LT(isolator.natural_frequency_hz(), 10);
}

TEST(Isolator, StepLengthDoesNotMatterForASteadySine) {
    // GIVEN two step lengths WHEN both run to the same time, transient included
    Isolator coarse(0.65, 15, 0.1, 2e-3);
    Isolator fine(0.65, 15, 0.1, 0.25e-3);
    coarse.set_drive(15, {0.05});
    fine.set_drive(15, {0.05});
    for (int i = 1; i <= 200; ++i) {
        coarse.advance(9);
        for (int j = 0; j < 8; ++j) fine.advance(9);
        // THEN they agree: the discretisation is exact
        ASSERT_NEAR(coarse.platform_g(), fine.platform_g(), 1e-10) << "step " << i;
    }
}

TEST(Isolator, SecondHarmonicPassesWithItsOwnTransmission) {
    Isolator isolator(2.0 / 3, 15, 0.2, 0.5e-3);
    isolator.set_drive(15, {0.05});
    const std::complex<double> t = measured(isolator, 15, 0.5e-3, 2);
    EXPECT_NEAR(std::abs(t - isolator.transfer(30)), 0, 1e-9);
    EXPECT_LT(std::abs(t), 0.4);
}

TEST(Isolator, RingsDownWithItsDamping) {
    // GIVEN a push of 1 g
    Isolator isolator(2.0 / 3, 15, 0.2, 0.5e-3);
    isolator.kick(1);
    EXPECT_NEAR(isolator.platform_g(), 1, 1e-12);
    // WHEN a damped period has passed THEN the acceleration has fallen by exp(-zeta w0 T)
    const double w0 = 2 * kPi * isolator.natural_frequency_hz();
    double before = isolator.platform_g();
    double largest_late = 0;
    const int steps = static_cast<int>(std::lround(2 / 0.5e-3));
    for (int i = 0; i < steps; ++i) {
        isolator.advance(0);
        if (i > steps / 2) largest_late = std::max(largest_late, std::abs(isolator.platform_g()));
    }
    EXPECT_LT(largest_late, 2 * before * std::exp(-0.2 * w0 * 1.0));
    EXPECT_GT(largest_late, 1e-3 * before * std::exp(-0.2 * w0 * 1.0));
}

TEST(Isolator, ManyStepsAtOnceAreTheSameAsOneByOne) {
    // GIVEN two isolators, one that may leap and one that goes step by step, for an hour of ramps,
    // steady vibration, rest and pushes
    constexpr std::uint64_t kSeed = 4;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    Isolator at_once(2.0 / 3, 15, 0.2, 0.5e-3), one_by_one(2.0 / 3, 15, 0.2, 0.5e-3);
    for (Isolator* isolator : {&at_once, &one_by_one}) isolator->set_drive(15, {});
    std::vector<Shake> together(50);
    double g = 0, largest = 0;
    for (int tick = 0; tick < 144'000; ++tick) {
        const auto what = random() % 4000;
        const double next = what == 0 ? 9 : what == 1 ? 0 : what < 100 ? g + 0.01 : g;
        const double slope = (next - g) / 50;
        if (what == 2) {
            at_once.kick(0.5);
            one_by_one.kick(0.5);
        }
        // WHEN both go on
        at_once.advance(g, slope, together);
        for (std::size_t i = 0; i < together.size(); ++i) {
            one_by_one.advance(g + slope * (static_cast<double>(i) + 0.5));
            const Shake now = one_by_one.shake();
            largest = std::max({largest, std::abs(now.in_phase - together[i].in_phase),
                                std::abs(now.quadrature - together[i].quadrature)});
        }
        g = next;
    }
    // THEN they are the same: 7.2e6 steps' rounding of the phase, 1e-16 each, of some 10 g
    EXPECT_LT(largest, 1e-10);
}

TEST(Isolator, RefusesATransmissionThatTheDampingForbids) {
    EXPECT_THROW(Isolator(2.0, 15, 0.9, 1e-3), PlantError);
}

}  // namespace
}  // namespace vibrig::plant
