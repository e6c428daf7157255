#include "estimator/allan/dwell_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <numeric>
#include <random>

#include "estimator/allan/dwell_basis.hpp"
#include "estimator/allan/edf.hpp"

namespace {

using namespace vibrig::estimator::allan;

constexpr double kRate = 40;  // samples/s
constexpr std::size_t kBlocks = 98;

struct Noise {
    double angle_arcsec = 5;
    double walk = 1e-3;    // deg/sqrt(h)
    double rate_walk = 0;  // deg/h^1.5
    double ramp = 0;       // deg/h^2
};

std::shared_ptr<const DwellBasis> basis_of(std::size_t blocks) {
    std::vector<std::size_t> present(blocks);
    std::iota(present.begin(), present.end(), std::size_t{0});
    return std::make_shared<const DwellBasis>(std::move(present));
}

const std::shared_ptr<const DwellBasis>& whole() {
    static const std::shared_ptr<const DwellBasis> basis = basis_of(kBlocks);
    return basis;
}

/// Block means as the resolver at 40 Hz would give them, with an offset and a rate.
DwellAngles dwell_of(const Noise& noise, std::mt19937_64& generator, double level = 6,
                     const std::shared_ptr<const DwellBasis>& basis = whole()) {
    std::normal_distribution<double> normal;
    DwellAngles dwell;
    dwell.basis = basis;
    dwell.level = level;
    dwell.white_share = 1 / kRate;
    const double dt = 1 / kRate;
    double angle = 1e4 * normal(generator);
    double rate = 3 * normal(generator);
    const double hours = 1 / 3600.0;
    std::size_t next = 0;
    for (std::size_t block = 0; block <= basis->present().back(); ++block) {
        double sum = 0;
        for (int i = 0; i < static_cast<int>(kRate); ++i) {
            rate +=
                noise.ramp * dt * hours + noise.rate_walk / 60 * std::sqrt(dt) * normal(generator);
            angle += rate * dt + 60 * noise.walk * std::sqrt(dt) * normal(generator);
            sum += angle + noise.angle_arcsec * normal(generator);
        }
        if (basis->present()[next] != block) continue;
        dwell.angle_arcsec.push_back(sum / kRate);
        ++next;
    }
    return dwell;
}

const FittedTerm& term(const DwellMonitor& monitor, Term which) {
    return monitor.terms()[static_cast<std::size_t>(which)];
}

DwellMonitor campaign(const Noise& noise, std::uint64_t seed, std::size_t dwells = 28) {
    std::mt19937_64 generator(seed);
    DwellMonitor monitor({});
    for (std::size_t d = 0; d < dwells; ++d) {
        monitor.learn(dwell_of(noise, generator, d < dwells / 2 ? 6 : 4.667));
    }
    return monitor;
}

TEST(DwellMonitor, PointsAreTheDeviationThatTheNoiseHas) {
    // GIVEN resolver noise alone: block means of variance s^2 have MDEV^2 = 3 s^2 / (m tau^2)
    constexpr double kAngle = 5;
    constexpr std::uint64_t kSeed = 31;
    constexpr std::size_t kDwells = 28;
    const DwellMonitor monitor = campaign({kAngle, 0, 0, 0}, kSeed, kDwells);
    const auto points = monitor.points();
    ASSERT_EQ(points.size(), whole()->octaves.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const DwellBasis::Octave& octave = whole()->octaves[i];
        const auto m = static_cast<double>(octave.m);
        EXPECT_EQ(points[i].tau_s, m);
        const double theory = 3 * kAngle * kAngle / kRate / (m * m * m);
        const double edf = kDwells * octave.white_trace * octave.white_trace / octave.white_square;
        const double tolerance = 5 * std::sqrt(2 / edf);
        EXPECT_NEAR(points[i].deviation * points[i].deviation / theory, 1, tolerance) << m;
        // What is identified is Q and, by chance, a little N, which shows at long times.
        EXPECT_NEAR(std::pow(points[i].deviation / points[i].expected, 2), 1, tolerance) << m;
    }
    EXPECT_TRUE(DwellMonitor({}).points().empty());
}

TEST(DwellMonitor, TheCurvesOfTheDwellsAreThePointsOfAll) {
    // GIVEN dwells of one length, WHEN each gives its curve, THEN their mean square is the points'
    std::mt19937_64 generator(33);
    DwellMonitor monitor({});
    constexpr std::size_t kDwells = 7;
    std::vector<double> squares(whole()->octaves.size(), 0);
    for (std::size_t d = 0; d < kDwells; ++d) {
        const DwellAngles dwell = dwell_of({5, 1e-3, 0, 0}, generator, 9);
        const auto curve = DwellMonitor::curve_of(dwell);
        ASSERT_EQ(curve.size(), squares.size());
        for (std::size_t i = 0; i < curve.size(); ++i)
            squares[i] += curve[i].deviation * curve[i].deviation / kDwells;
        monitor.learn(dwell);
    }
    const auto points = monitor.points();
    ASSERT_EQ(points.size(), squares.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        EXPECT_NEAR(std::sqrt(squares[i]) / points[i].deviation, 1, 1e-12) << points[i].tau_s;
}

TEST(DwellMonitor, MonteCarloTheClassicalVarianceIsThatOfAveragesAboutTheDwellsOwnMean) {
    // GIVEN dwells of resolver noise and random walk with any offset and rate, of which one block
    // is missing after 70 of 98
    constexpr std::uint64_t kSeed = 34;
    constexpr int kDwells = 200;
    constexpr std::size_t kRow = 70;
    std::vector<std::size_t> present(kBlocks - 1);
    for (std::size_t i = 0; i < present.size(); ++i) present[i] = i + (i >= kRow ? 1 : 0);
    const auto gapped = std::make_shared<const DwellBasis>(std::move(present));
    std::mt19937_64 generator(kSeed);
    const Noise noise{5, 3e-3, 0, 0};
    std::vector<double> squares(gapped->octaves.size(), 0);
    for (int d = 0; d < kDwells; ++d) {
        const auto curve = DwellMonitor::curve_of(dwell_of(noise, generator, 6, gapped));
        for (std::size_t i = 0; i < curve.size(); ++i)
            squares[i] += curve[i].classical * curve[i].classical / kDwells;
    }
    // THEN it is sigma_c^2(tau) - sigma_c^2(T), T covered by whole averages in the longest row
    const double white = noise.angle_arcsec * noise.angle_arcsec / kRate;
    const double walk = 60 * noise.walk * 60 * noise.walk;
    // Of block means a third of a block of the walk is lost.
    const auto classical = [&](double tau) {
        return (2 * white + walk * (tau - 1.0 / 3)) / (tau * tau);
    };
    for (std::size_t i = 0; i < squares.size(); ++i) {
        const std::size_t m = gapped->octaves[i].m, tiles = (kRow - 1) / m;
        const double theory =
            classical(static_cast<double>(m)) - classical(static_cast<double>(m * tiles));
        // The tiles of one position alone have about so many degrees of freedom.
        const double degrees = kDwells * static_cast<double>(tiles - 1);
        EXPECT_NEAR(squares[i] / theory, 1, 4 * std::sqrt(2 / degrees))
            << m << " s, seed " << kSeed;
    }
}

TEST(DwellMonitor, MonteCarloErrorsOfNAreThoseItStates) {
    // GIVEN campaigns of 28 dwells of 100 s at two levels, the noise of the default rig
    constexpr int kRuns = 24;
    constexpr std::uint64_t kSeed = 5100;
    double mean = 0, squares = 0, claimed = 0, q_squares = 0, q_claimed = 0;
    int slow = 0;
    for (int run = 0; run < kRuns; ++run) {
        const DwellMonitor monitor = campaign({}, kSeed + static_cast<unsigned>(run));
        // WHEN all dwells are taken together
        const FittedTerm& n = term(monitor, Term::N);
        const FittedTerm& q = term(monitor, Term::Q);
        EXPECT_TRUE(n.detected) << "seed " << kSeed + static_cast<unsigned>(run);
        mean += n.value / kRuns;
        squares += std::pow(n.value - 1e-3, 2) / kRuns;
        claimed += n.sigma * n.sigma / kRuns;
        q_squares += std::pow(q.value - 5, 2) / kRuns;
        q_claimed += q.sigma * q.sigma / kRuns;
        for (const Term which : {Term::B, Term::K, Term::R}) {
            slow += term(monitor, which).detected ? 1 : 0;
            EXPECT_GT(term(monitor, which).below, 0);
        }
        // and one dwell shows only a large change of N
        EXPECT_GT(monitor.smallest_change(), 1.5);
    }
    // THEN errors are as large as stated: squares over claim within chi-square of 24 at 1e-4
    const double low = chi_square_quantile(5e-5, kRuns) / kRuns;
    const double high = chi_square_quantile(1 - 5e-5, kRuns) / kRuns;
    EXPECT_GT(squares / claimed, low) << "seeds from " << kSeed;
    EXPECT_LT(squares / claimed, high) << "seeds from " << kSeed;
    EXPECT_GT(q_squares / q_claimed, low);
    EXPECT_LT(q_squares / q_claimed, high);
    EXPECT_NEAR(mean, 1e-3, 4 * std::sqrt(claimed / kRuns));
    // and the slow terms are not detected (72 tests at three standard errors, skewed)
    EXPECT_LE(slow, 3);
}

TEST(DwellMonitor, SlowTermsAreBoundedAndStrongOnesDetected) {
    // GIVEN a campaign with N only: the bounds are far above a good gyro's terms
    const DwellMonitor calm = campaign({}, 5200);
    EXPECT_FALSE(term(calm, Term::K).detected);
    const double bound = term(calm, Term::K).below;
    EXPECT_GT(bound, 0.01);
    // WHEN the rate walks five times faster than the bound, or ramps, THEN it is found
    const DwellMonitor walking = campaign({5, 1e-3, 5 * bound, 0}, 5201);
    EXPECT_TRUE(term(walking, Term::K).detected);
    const double ramp = 8 * term(calm, Term::R).below;
    const DwellMonitor ramping = campaign({5, 1e-3, 0, ramp}, 5202);
    const FittedTerm& r = term(ramping, Term::R);
    EXPECT_TRUE(r.detected);
    EXPECT_NEAR(r.value, ramp, 0.5 * ramp);
}

TEST(DwellMonitor, WithoutRandomWalkNIsNotDetected) {
    const FittedTerm n = term(campaign({5, 0, 0, 0}, 5300), Term::N);
    EXPECT_FALSE(n.detected);
    EXPECT_GT(n.below, 0);
    EXPECT_LT(n.below, 1e-3);
}

TEST(DwellMonitor, ContradictsAWrongNOnly) {
    const DwellMonitor monitor = campaign({}, 5400);
    EXPECT_LT(std::abs(monitor.distance_from(1e-3)), 4);
    EXPECT_GT(monitor.distance_from(4e-4), 4);
    const DwellMonitor wild = campaign({5, 3e-3, 0, 0}, 5401);
    EXPECT_GT(wild.distance_from(1e-3), 4);
    EXPECT_NEAR(term(wild, Term::N).value, 3e-3, 4 * term(wild, Term::N).sigma);
}

TEST(DwellMonitor, AlarmsReadWhatHasChanged) {
    // GIVEN dwells that have taught the noise of a level
    std::mt19937_64 generator(5500);
    DwellMonitor monitor({});
    int alarms = 0;
    constexpr int kDwells = 60;
    for (int d = 0; d < kDwells; ++d) {
        const DwellAngles dwell = dwell_of({}, generator);
        alarms += monitor.check(dwell).empty() ? 0 : 1;
        monitor.learn(dwell);
    }
    // THEN hardly one of 55 of the same kind alarmed (expected 55 * 1e-3 / 3)
    EXPECT_LE(alarms, 2) << "seed 5500";
    // WHEN the resolver's noise doubles, THEN the short averaging times say so
    const auto resolver = monitor.check(dwell_of({10, 1e-3, 0, 0}, generator));
    ASSERT_FALSE(resolver.empty());
    EXPECT_EQ(resolver.front().reading, Reading::short_tau);
    EXPECT_NEAR(resolver.front().ratio, 4, 2);
    EXPECT_GT(resolver.front().ratio, resolver.front().limit);
    // WHEN N grows by three times what the monitor says it sees, THEN longer ones do, these not
    const double change = 3 * monitor.smallest_change();
    const auto walk = monitor.check(dwell_of({5, change * 1e-3, 0, 0}, generator));
    ASSERT_FALSE(walk.empty());
    EXPECT_NE(walk.back().reading, Reading::short_tau);
    // and another level has no reference yet
    EXPECT_TRUE(monitor.check(dwell_of({10, 1e-3, 0, 0}, generator, 4.667)).empty());
}

TEST(DwellMonitor, MonteCarloFalseAlarmsAreAsManyAsAlphaSays) {
    // GIVEN campaigns of two levels with 14 dwells each, all of one kind; four readings to a block,
    // each as good as ten
    constexpr int kCampaigns = 400, kReadings = 4;
    int checks = 0, alarms = 0;
    for (int c = 0; c < kCampaigns; ++c) {
        std::mt19937_64 generator(9000 + static_cast<std::uint64_t>(c));
        std::normal_distribution<double> normal;
        DwellMonitor monitor({});
        for (int d = 0; d < 28; ++d) {
            DwellAngles dwell;
            dwell.basis = whole();
            dwell.level = d < 14 ? 6 : 4.667;
            dwell.white_share = 1.0 / kReadings;
            double angle = 0;
            for (std::size_t block = 0; block < kBlocks; ++block) {
                double sum = 0;
                for (int i = 0; i < kReadings; ++i) {
                    angle += 60 * 1e-3 * std::sqrt(1.0 / kReadings) * normal(generator);
                    sum += angle + 5 * std::sqrt(kReadings / kRate) * normal(generator);
                }
                dwell.angle_arcsec.push_back(sum / kReadings);
            }
            // Five dwells of a level teach before one is judged.
            checks += d % 14 >= 5 ? 1 : 0;
            if (monitor.check(dwell).empty()) {
                monitor.learn(dwell);
            } else {
                ++alarms;
            }
        }
    }
    // THEN a third of alpha is one gyro's share: 2.4 alarms of 7200 dwells are expected, and 9 or
    // more in one trial of a thousand. A campaign of three gyros has one in 1 of 55 cases, six
    // campaigns in 1 of 10.
    std::printf("%d false alarms in %d dwells of one gyro, %.1f expected\n", alarms, checks,
                checks * 1e-3 / 3);
    EXPECT_LE(alarms, 8) << "seeds from 9000";
}

TEST(DwellMonitor, ADwellWithAGapCounts) {
    // GIVEN dwells with blocks missing in the middle
    std::vector<std::size_t> present;
    for (std::size_t i = 0; i < kBlocks; ++i) {
        if (i < 30 || i > 39) present.push_back(i);
    }
    const auto basis = std::make_shared<const DwellBasis>(present);
    std::mt19937_64 generator(5600);
    DwellMonitor monitor({});
    for (int d = 0; d < 28; ++d) monitor.learn(dwell_of({}, generator, 6, basis));
    const FittedTerm& n = term(monitor, Term::N);
    EXPECT_NEAR(n.value, 1e-3, 4 * n.sigma);
    // THEN no difference spans the gap: a step of the angle there is none of the octaves' business
    DwellAngles stepped = dwell_of({}, generator, 6, basis);
    EXPECT_TRUE(monitor.check(stepped).empty());
    for (std::size_t i = 30; i < stepped.angle_arcsec.size(); ++i) stepped.angle_arcsec[i] += 1e3;
    EXPECT_TRUE(monitor.check(stepped).empty());
}

}  // namespace
