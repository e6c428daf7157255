#include "daemon/study/draws.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

namespace vibrig::study {
namespace {

using Words = std::array<std::uint32_t, 4>;

// Known answers of the authors' Random123, file kat_vectors.
TEST(Philox, GivesTheKnownAnswers) {
    EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}),
              (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
    constexpr std::uint32_t f = 0xffffffff;
    EXPECT_EQ(philox({f, f, f, f}, {f, f}),
              (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
    EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
              (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Draws, DependOnSeedIndexAndPurposeAndOnNothingElse) {
    std::vector<std::uint64_t> alone;
    Draws once(1, 7, "noise");
    for (int i = 0; i < 100; ++i) alone.push_back(once.bits());
    // Others draw between its draws, each time more often.
    Draws disturbed(1, 7, "noise"), other(1, 7, "platform.slew_error_deg"), next(1, 8, "noise");
    for (std::size_t i = 0; i < alone.size(); ++i) {
        for (std::size_t times = 0; times < i; ++times) {
            static_cast<void>(other.bits());
            static_cast<void>(next.normal());
        }
        EXPECT_EQ(disturbed.bits(), alone[i]) << i;
    }
    EXPECT_NE(Draws(1, 7, "noise").bits(), Draws(2, 7, "noise").bits());
    EXPECT_NE(Draws(1, 7, "noise").bits(), Draws(1, 8, "noise").bits());
    EXPECT_NE(Draws(1, 7, "noise").bits(), Draws(1, 7, "other").bits());
    // Beyond 32 bits as well.
    EXPECT_NE(Draws(1, 7, "noise").bits(), Draws(1, 7 + (std::uint64_t{1} << 32), "noise").bits());
    EXPECT_NE(Draws(1, 7, "noise").bits(), Draws(1 + (std::uint64_t{1} << 32), 7, "noise").bits());
}

/// Mean and variance over `n` tasks, one draw of each.
void expect_moments(const Distribution& distribution, double mean, double variance) {
    constexpr int kDraws = 20'000;
    const std::uint64_t seed = 5;
    SCOPED_TRACE("seed " + std::to_string(seed));
    double sum = 0, squares = 0;
    for (std::uint64_t index = 0; index < kDraws; ++index) {
        Draws draws(seed, index, "key");
        const double x = distribution.draw(draws);
        sum += x - mean;
        squares += (x - mean) * (x - mean);
    }
    // Five standard deviations; fourth moments are at most three times the variance's square.
    EXPECT_NEAR(sum / kDraws, 0, 5 * std::sqrt(variance / kDraws));
    EXPECT_NEAR(squares / kDraws, variance, 5 * variance * std::sqrt(2.0 / kDraws));
}

TEST(Distribution, HasItsMomentsOverTheTasks) {
    using Shape = Distribution::Shape;
    expect_moments({Shape::normal, 3, 2, -1e9, 1e9}, 3, 4);
    expect_moments({Shape::rectangular, -50, 50, -1e9, 1e9}, 0, 100.0 * 100 / 12);
    expect_moments({Shape::triangular, 0, 2, -1e9, 1e9}, 1, 4.0 / 24);
    expect_moments({Shape::arcsine, -1, 3, -1e9, 1e9}, 1, 2);
    // Cut at zero, a normal one about it is half of one: mean sqrt(2 / pi), variance 1 - 2 / pi.
    const double mean = std::sqrt(2 / std::numbers::pi);
    expect_moments({Shape::normal, 0, 1, 0, 5}, mean, 1 - mean * mean);
}

}  // namespace
}  // namespace vibrig::study
