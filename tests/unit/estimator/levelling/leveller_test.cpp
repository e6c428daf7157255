#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "estimator/filter/angles.hpp"
#include "estimator/levelling/simulation.hpp"
#include "tests/unit/support/allocation_count.hpp"

namespace {

using namespace vibrig::estimator::levelling;
using vibrig::estimator::kDegPerHour;
using vibrig::estimator::kPi;
using vibrig::estimator::kRadPerArcmin;

constexpr double kG = 9.80665;
constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

LevellerSettings rig() {
    LevellerSettings s;
    s.fast = design({100, 0.005, 0.7}).gains;
    s.settling_s = 100;
    s.period_s = 0.1;
    s.window_s = 10;
    s.tolerance_rad = 0.2 * kRadPerArcmin;
    s.noise.accelerometer_mps2 = 1e-5 * kG;
    return s;
}

/// The platform under the loop: tilt rate is drift minus what is torqued.
struct Platform {
    Pair tilt{};
    Pair drift{};
    Pair zero{};
    [[nodiscard]] LevelInput input() const {
        LevelInput in;
        for (std::size_t i = 0; i < 2; ++i) in.force[i] = kG * tilt[i] + zero[i];
        return in;
    }
    void move(const Pair& rate, double period) {
        for (std::size_t i = 0; i < 2; ++i) tilt[i] += period * (drift[i] - rate[i]);
    }
};

/// Runs for a time; `spoil` may change the input of step k.
LevelOutput run(Leveller& loop, Platform& platform, double seconds, double period,
                const std::function<void(LevelInput&, int)>& spoil = {}) {
    LevelOutput out;
    for (int k = 0; k < static_cast<int>(seconds / period + 0.5); ++k) {
        LevelInput input = platform.input();
        if (spoil) spoil(input, k);
        out = loop.step(input);
        platform.move(out.rate, period);
    }
    return out;
}

void expect_words(const std::string& text, const std::vector<std::string>& words) {
    for (const std::string& word : words) {
        EXPECT_NE(text.find(word), std::string::npos) << word << " not in: " << text;
    }
}

TEST(LevellingManyStarts, All1000AreDeclaredInTimeAndNoneFalsely) {
    // GIVEN 1000 starts: tilt up to 0.5 deg, drift 0.1 deg/h, a step of 2' at any time
    const LevellerSettings settings = rig();
    const double sigma = mean_decay(settings.fast);
    const double bound = 1.05 * (settings.settling_s + settings.window_s + 1 / sigma);
    std::vector<double> times;
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
        std::mt19937_64 generator(seed);
        std::uniform_real_distribution<double> uniform(-1, 1);
        Scenario start;
        start.loop = settings;
        start.seed = seed;
        start.until_settled = true;
        start.duration_s = 3 * settings.settling_s;
        for (std::size_t i = 0; i < 2; ++i) {
            start.tilt[i] = 0.5 * kPi / 180 * uniform(generator);
            start.drift[i] = std::copysign(0.1 * kDegPerHour, uniform(generator));
            start.step[i] = std::copysign(2 * kRadPerArcmin, uniform(generator));
        }
        start.step_s = settings.settling_s * (1 + uniform(generator));
        // WHEN each runs
        const SimulatedStart result = simulate(start);
        // THEN it is declared in time, counted from the step if that came before
        ASSERT_EQ(result.verdict, Verdict::settled) << "seed " << seed << ' ' << result.message;
        const double begin = start.step_s < result.settled_s ? start.step_s : 0;
        EXPECT_LE(result.settled_s - begin, bound) << "seed " << seed;
        // AND never with a true tilt above twice the tolerance
        for (const double tilt : result.tilt_when_settled) {
            EXPECT_LE(std::abs(tilt), 2 * settings.tolerance_rad) << "seed " << seed;
        }
        times.push_back(result.settled_s);
    }
}

TEST(LevellingManyStarts, AreDeclaredWithinTheTimeThatIsSaidOfThem) {
    // GIVEN loops whose bands are narrow against the noise of the means, or against the tilt
    struct Case {
        double settling_s, period_s, window_s, tolerance, tilt;  // arcmin
        Noise noise;
    };
    const Noise quiet{0, 1e-5 * kG, 0};
    const std::vector<Case> cases{{100, 0.1, 1, 0, 10, quiet},
                                  {100, 0.1, 1, 0, 250, quiet},
                                  {600, 1, 1, 0, 30, quiet},
                                  {100, 0.1, 1, 0, 30, {0, 3e-5 * kG, 0}},
                                  {100, 0.9, 0.9, 0, 30, quiet},
                                  {600, 1, 1, 0, 10, {0, 1e-5 * kG, 0.005 * kRadPerArcmin}},
                                  {600, 1, 1, 0, 10, {0.2, 1e-5 * kG, 0}},
                                  {100, 0.1, 1, 0.0448, 30, quiet}};
    for (const Case& c : cases) {
        Scenario start;
        start.loop.fast = design({c.settling_s, 0.005, 0.7}).gains;
        start.loop.settling_s = c.settling_s;
        start.loop.period_s = c.period_s;
        start.loop.window_s = c.window_s;
        start.loop.tolerance_rad = c.tolerance * kRadPerArcmin;
        start.loop.noise = c.noise;
        start.until_settled = true;
        start.duration_s = kPatience * c.settling_s;
        const double drift = 0.1 * kDegPerHour;
        const auto within = declared_within_s(start.loop, c.tilt * kRadPerArcmin, drift);
        ASSERT_TRUE(within.has_value()) << c.settling_s << ' ' << c.tilt;
        // WHEN 100 start with tilts of at least half of that
        constexpr std::uint64_t kStarts = 100;
        std::uint64_t late = 0;
        for (start.seed = 1; start.seed <= kStarts; ++start.seed) {
            std::mt19937_64 generator(start.seed ^ 0x77U);
            std::uniform_real_distribution<double> half(0.5, 1);
            for (std::size_t i = 0; i < 2; ++i) {
                start.tilt[i] = half(generator) * c.tilt * kRadPerArcmin;
                start.drift[i] = std::copysign(drift, half(generator) - 0.75);
            }
            const SimulatedStart result = simulate(start);
            ASSERT_EQ(result.verdict, Verdict::settled)
                << "seed " << start.seed << ' ' << result.message;
            late += result.settled_s > 1.05 * *within ? 1U : 0U;
        }
        // THEN all are declared and at most one in twenty late
        EXPECT_LE(late, kStarts / 20)
            << c.settling_s << " s, tilt " << c.tilt << "', seeds 1 to " << kStarts;
    }
    // AND nothing is promised that the loop does not wait for
    LevellerSettings weak = rig();
    weak.torquer_limit = 10 * kDegPerHour;  // 50' in three settling times
    EXPECT_FALSE(declared_within_s(weak, 60 * kRadPerArcmin, 0).has_value());
}

TEST(Leveller, FindsTheDriftAndLeavesOnlyTheZero) {
    // GIVEN a tilted platform with drift and accelerometer zeros
    Leveller loop(rig());
    Platform platform{{20 * kRadPerArcmin, -15 * kRadPerArcmin},
                      {3 * kDegPerHour, -8 * kDegPerHour},
                      {1e-4 * kG, -2e-4 * kG}};
    // WHEN it has run for 400 s
    const LevelOutput out = run(loop, platform, 400, 0.1);
    // THEN the drift is found and the tilt is minus the zero over g
    EXPECT_EQ(out.verdict, Verdict::settled);
    EXPECT_NEAR(loop.drift()[0] / kDegPerHour, 3, 1e-3);
    EXPECT_NEAR(loop.drift()[1] / kDegPerHour, -8, 1e-3);
    EXPECT_NEAR(platform.tilt[0] / kRadPerArcmin, -0.34378, 1e-3);
    EXPECT_NEAR(platform.tilt[1] / kRadPerArcmin, 2 * 0.34378, 1e-3);
    EXPECT_EQ(loop.message(), "");
}

TEST(Leveller, AWrongSignOrGainDoesNotSettle) {
    // GIVEN a loop whose command moves the platform the wrong way, or a tenth as far as it should
    for (const double sign : {-1.0, 0.1}) {
        Leveller loop(rig());
        Platform platform{{10 * kRadPerArcmin, 10 * kRadPerArcmin}, {}, {}};
        LevelOutput out;
        for (int k = 0; k < 3500; ++k) {
            out = loop.step(platform.input());
            platform.move({sign * out.rate[0], sign * out.rate[1]}, 0.1);
            if (sign < 0) {
                for (double& tilt : platform.tilt) tilt = std::clamp(tilt, -0.5, 0.5);
            }
        }
        // THEN it is never called settled
        EXPECT_FALSE(loop.settled_s().has_value()) << sign;
        EXPECT_NE(out.verdict, Verdict::settled) << sign;
    }
}

TEST(Leveller, HoldsFastGainsUntilSettledAndThenRampsWithoutAStep) {
    // GIVEN the schedule of Zha et al. 2019 with a tilt of 10'
    LevellerSettings s;
    s.fast = gains_of(0.0088, 0.7);
    s.slow = Gains{7.68e-3, 6.68, 7.68e-3};
    s.settling_s = 600;
    s.period_s = 1;
    Scenario start;
    start.loop = s;
    start.tilt = {10 * kRadPerArcmin, 0};
    start.duration_s = 14400;
    const SimulatedStart result = simulate(start);
    // THEN the tilt is within 2 % after 540 s, as with fast gains alone, and stays there
    EXPECT_NEAR(result.last_above(0.02), 540, 10);
    ASSERT_GT(result.settled_s, 0);
    // AND while the gains ramp (60 s) and at their end the command makes no step: it changes less
    // from sample to sample than the settled loop may still demand, tol * sigma
    const double most = 0.05 * kRadPerArcmin * 0.0088;
    for (std::size_t k = static_cast<std::size_t>(result.settled_s) - 1; k + 1 < 2000; ++k) {
        EXPECT_LT(std::abs(result.trace[k + 1].rate[0] - result.trace[k].rate[0]), most) << k;
    }
}

TEST(Leveller, ChangesOfK1AndK3MakeNoStepOfK2OneOfItsSize) {
    FastNetwork network{Earth{}};
    const Gains gains = gains_of(0.05, 0.7);
    for (int k = 0; k < 50; ++k) network.step(0.01, 0.3, gains, 0.1);
    const double z = network.z();
    // WHEN a gain changes from here on, over a period that tends to nothing
    constexpr double kSmall = 1e-12;
    const auto command = [&](const Gains& changed) {
        FastNetwork copy = network;
        return copy.step(0.01, 0.3, changed, kSmall);
    };
    const double before = command(gains);
    const double radius = Earth{}.radius_m;
    EXPECT_NEAR(command({2 * gains.k1, gains.k2, gains.k3}), before, 1e-9 * std::abs(before));
    EXPECT_NEAR(command({gains.k1, gains.k2, 2 * gains.k3}), before, 1e-9 * std::abs(before));
    EXPECT_NEAR(command({gains.k1, gains.k2 + 10, gains.k3}) - before, 10 * network.w() / radius,
                1e-9 * std::abs(before));
    EXPECT_GT(std::abs(z), 0);
    // AND becoming undamped makes none at all
    FastNetwork copy = network;
    copy.become_undamped(0.3, gains);
    EXPECT_NEAR(copy.step(0, 0.3, {}, kSmall), before, 1e-9 * std::abs(before));
}

TEST(Leveller, MissingSamplesAndNansHoldTheLoop) {
    struct Case {
        std::function<void(LevelInput&)> spoil;
        int samples;
        std::vector<std::string> words;
    };
    const std::vector<Case> cases{
        {[](LevelInput& in) { in.missing = true; }, 3, {}},
        {[](LevelInput& in) { in.missing = true; }, 30, {"missing since 50", "not integrating"}},
        {[](LevelInput& in) { in.force[1] = kNoValue; },
         1,
         {"second channel", "not a number", "50"}},
        {[](LevelInput& in) { in.reference[0] = kNoValue; },
         5,
         {"reference", "first", "not a number"}},
        {[](LevelInput& in) { in.force[0] = std::numeric_limits<double>::infinity(); },
         1,
         {"first channel"}}};
    for (const auto& [spoil, samples, words] : cases) {
        // GIVEN a loop under way
        Leveller loop(rig());
        Platform platform{
            {5 * kRadPerArcmin, 5 * kRadPerArcmin}, {8 * kDegPerHour, 8 * kDegPerHour}, {}};
        run(loop, platform, 50, 0.1);
        const double z = loop.axis(0).z();
        const double last = loop.step(platform.input()).rate[0];
        // WHEN samples are bad
        LevelOutput out;
        for (int k = 0; k < samples; ++k) {
            LevelInput input = platform.input();
            spoil(input);
            out = loop.step(input);
        }
        // THEN the drift found so far is torqued, or for up to three samples the last command
        const double radius = Earth{}.radius_m;
        EXPECT_NEAR(loop.axis(0).z(), z, std::abs(0.1 * 192.1 * loop.axis(0).w()) + 1e-15);
        EXPECT_DOUBLE_EQ(out.rate[0], words.empty() ? last : loop.axis(0).z() / radius);
        expect_words(loop.message(), words);
        // AND afterwards it settles
        EXPECT_EQ(run(loop, platform, 200, 0.1).verdict, Verdict::settled);
    }
}

TEST(Leveller, WithoutItsReferenceItBecomesUndampedWithoutAStep) {
    Leveller loop(rig());
    Platform platform{{5 * kRadPerArcmin, 0}, {}, {}};
    run(loop, platform, 20, 0.1);
    const double before = loop.step(platform.input()).rate[0];
    LevelInput stale = platform.input();
    // 1 / (3 sigma) is 6.35 s
    stale.reference_age_s = 6.3;
    EXPECT_EQ(loop.step(stale).phase, Phase::fast);
    stale.reference_age_s = 6.4;
    const LevelOutput out = loop.step(stale);
    EXPECT_EQ(out.phase, Phase::undamped);
    EXPECT_EQ(out.verdict, Verdict::cannot_settle);
    EXPECT_NEAR(out.rate[0], before, 0.05 * std::abs(before));
    expect_words(loop.message(),
                 {"external reference lost: fast network cannot be used without it (it would "
                  "follow the carrier's acceleration); switched to undamped"});
    // A reference whose age is not known is lost too.
    Leveller other(rig());
    stale.reference_age_s = kNoValue;
    EXPECT_EQ(other.step(stale).phase, Phase::undamped);
}

TEST(Leveller, TooLargeATiltAsksForCoarseLevelling) {
    Leveller loop(rig());
    Platform platform{{0, 8 * kPi / 180}, {}, {}};
    const LevelOutput out = run(loop, platform, 2, 0.1);
    EXPECT_EQ(out.verdict, Verdict::cannot_settle);
    expect_words(loop.message(),
                 {"second channel", "about 7.99 deg", "5 deg", "coarse levelling first"});
}

TEST(Leveller, SaturatesWithoutWindingUp) {
    // GIVEN a torquer that can do 60 deg/h where 130 are asked for
    LevellerSettings s = rig();
    s.torquer_limit = 60 * kDegPerHour;
    Leveller loop(s);
    Platform platform{{0.5 * kPi / 180, 0}, {}, {}};
    double least = 1;
    double largest = 0;
    LevelOutput out;
    for (int k = 0; k < 3000; ++k) {
        out = loop.step(platform.input());
        platform.move(out.rate, 0.1);
        largest = std::max(largest, std::abs(out.rate[0]));
        least = std::min(least, platform.tilt[0]);
    }
    // THEN it never commands more, does not overshoot by more than the linear loop (whose largest
    // undershoot is 20 % of the start), and settles
    EXPECT_LE(largest, s.torquer_limit);
    double linear = 0;
    for (double x = 0; x < 20; x += 0.01) linear = std::min(linear, initial_response(x, 0.7));
    EXPECT_GE(least, linear * 0.5 * kPi / 180 * 1.02);
    EXPECT_EQ(out.verdict, Verdict::settled);
    expect_words(loop.message(), {"torquer limit 60 deg/h", "first channel", "demanded"});
    // AND a drift that it cannot hold is called by its name
    Leveller hopeless(s);
    Platform drifting{{0, 0}, {90 * kDegPerHour, 0}, {}};
    out = run(hopeless, drifting, 310, 0.1);
    EXPECT_EQ(out.verdict, Verdict::cannot_settle);
    expect_words(hopeless.message(), {"torquer limit of 60 deg/h", "first channel"});
}

TEST(Leveller, NotSettledSaysWhatItSees) {
    // GIVEN a platform that never comes to rest: 2' back and forth
    Leveller loop(rig());
    Platform platform{};
    const LevelOutput out = run(loop, platform, 310, 0.1, [](LevelInput& in, int k) {
        in.force[0] += (k / 100) % 2 == 0 ? 2 * kRadPerArcmin * kG : -2 * kRadPerArcmin * kG;
    });
    EXPECT_EQ(out.verdict, Verdict::not_settled);
    expect_words(loop.message(),
                 {"not settled within 300 s",
                  "mean specific force of the first channel was the last to leave its band",
                  "against 0.2'", "noise", "accelerometer"});
    // AND a tolerance below the noise is refused from the start
    LevellerSettings s = rig();
    s.noise.accelerometer_mps2 = 1e-2 * kG;
    s.tolerance_rad = 0.05 * kRadPerArcmin;
    Leveller hopeless(s);
    EXPECT_EQ(hopeless.step({}).verdict, Verdict::cannot_settle);
    expect_words(hopeless.message(),
                 {"cannot settle", "below 4 times the noise", "accelerometer", "no window"});
    // AND the tolerance that it names does
    const std::string said = hopeless.message();
    const auto at = said.find("expected at least ");
    ASSERT_NE(at, std::string::npos) << said;
    s.tolerance_rad = std::stod(said.substr(at + 18)) * kRadPerArcmin;
    EXPECT_NEAR(s.tolerance_rad, hopeless.tolerance_needed(), 0.01 * hopeless.tolerance_needed());
    EXPECT_EQ(Leveller(s).verdict(), Verdict::settling) << said;
    // AND the default tolerance follows the noise: of the tilt and, over 100 samples, of the means
    s.tolerance_rad = 0;
    s.noise.accelerometer_mps2 = 2e-3 * kG;
    EXPECT_NEAR(Leveller(s).tolerance(), 4 * std::hypot(Leveller(s).budget().total, 2e-3 / 10),
                1e-9);
    // AND up to 5' only: beyond that nothing is level
    s.noise.accelerometer_mps2 = 1e-2 * kG;
    Leveller noisy(s);
    EXPECT_NEAR(noisy.tolerance(), 5 * kRadPerArcmin, 1e-12);
    EXPECT_EQ(noisy.step({}).verdict, Verdict::cannot_settle);
    // AND what the mean over one sample cannot do, that over the window named can
    LevellerSettings brief = rig();
    brief.window_s = 0.1;
    EXPECT_EQ(Leveller(brief).verdict(), Verdict::settling);  // 4 x 0.0345' against 0.2'
    brief.tolerance_rad = 0.05 * kRadPerArcmin;
    const Leveller refused(brief);
    EXPECT_EQ(refused.verdict(), Verdict::cannot_settle);
    ASSERT_TRUE(refused.window_needed_s().has_value());
    // 0.034378'^2 / (0.0125'^2 - 0.002628'^2) samples: 7.9
    EXPECT_NEAR(*refused.window_needed_s(), 0.8, 1e-9);
    expect_words(refused.message(), {"a window of 0.8 s would do"});
    brief.window_s = 0.8;
    EXPECT_EQ(Leveller(brief).verdict(), Verdict::settling);
    s.noise = {};
    EXPECT_NEAR(Leveller(s).tolerance() / kRadPerArcmin, 0.05, 1e-12);
}

TEST(Leveller, ANoisyReferenceStillSettles) {
    // GIVEN the paper's reference: 0.2 m/s per second, 0.5 m/s wrong
    Scenario start;
    start.loop.fast = gains_of(0.0088, 0.7);
    start.loop.settling_s = 600;
    start.loop.period_s = 1;
    start.loop.noise.reference_mps = 0.2;
    start.reference_error = {0.5, -0.5};
    start.tilt = {3 * kRadPerArcmin, -3 * kRadPerArcmin};
    start.duration_s = 1800;
    start.seed = 3;
    const SimulatedStart result = simulate(start);
    EXPECT_EQ(result.verdict, Verdict::settled) << result.message << ", seed 3";
    EXPECT_NEAR(result.drift[0] / kDegPerHour, 0, 0.5);
}

TEST(Leveller, AllocatesNothingWhileItRuns) {
    Leveller loop(rig());
    Platform platform{{5 * kRadPerArcmin, 1 * kRadPerArcmin}, {}, {}};
    const std::uint64_t before = vibrig::test::allocations();
    for (int k = 0; k < 3000; ++k) {
        LevelInput input = platform.input();
        input.missing = k % 97 == 0;
        platform.move(loop.step(input).rate, 0.1);
    }
    EXPECT_EQ(vibrig::test::allocations() - before, 0U);
}

}  // namespace
