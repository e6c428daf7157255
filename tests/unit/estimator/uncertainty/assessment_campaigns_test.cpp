#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iostream>
#include <random>
#include <string>
#include <utility>

#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

// Whole campaigns as their rows, with what the bias did added to them.

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::add_noise;
using estimator::testing::kTable2;
using Rows = std::vector<DwellRow>;
using Random = std::mt19937_64;
/// Adds what the rig did to the rates.
using Misdeed = std::function<void(Rows&, Random&)>;

double gauss(Random& random) { return std::normal_distribution<double>()(random); }
double sign(Random& random) { return random() % 2 == 0 ? 1.0 : -1.0; }

Misdeed step(double size, std::size_t after) {
    return [=](Rows& rows, Random& random) {
        for (std::size_t j = 0; j < 3; ++j) {
            const double s = size * sign(random);
            for (std::size_t k = after; k < rows.size(); ++k) rows[k].rate[j] += s;
        }
    };
}

Misdeed ramp(double per_hour) {
    return [=](Rows& rows, Random& random) {
        for (std::size_t j = 0; j < 3; ++j) {
            const double s = per_hour * sign(random);
            for (DwellRow& row : rows) row.rate[j] += s * (row.middle_s - rows[0].middle_s) / 3600;
        }
    };
}

Misdeed walk(double per_root_hour) {
    return [=](Rows& rows, Random& random) {
        for (std::size_t j = 0; j < 3; ++j) {
            double bias = 0;
            for (std::size_t k = 1; k < rows.size(); ++k) {
                const double h = (rows[k].middle_s - rows[k - 1].middle_s) / 3600;
                bias += per_root_hour * std::sqrt(h) * gauss(random);
                rows[k].rate[j] += bias;
            }
        }
    };
}

Misdeed scatter(double size) {
    return [=](Rows& rows, Random& random) {
        for (DwellRow& row : rows) {
            for (double& rate : row.rate) rate += size * gauss(random);
        }
    };
}

struct Tally {
    double rms = 0, within_2 = 0, nees = 0;
    int valid = 0, doubtful = 0, not_valid = 0;
};

/// Errors in u_A against the truth whose D_F is its mean over the dwells.
Tally campaigns(const std::vector<estimator::testing::PlannedRow>& plan, const Misdeed& misdeed,
                int count, std::uint64_t seed) {
    Settings settings;
    const Rows clean = estimator::testing::theory_rows(settings, plan);
    Random random(seed);
    Tally tally;
    for (int c = 0; c < count; ++c) {
        Rows rows = clean;
        if (misdeed) misdeed(rows, random);
        std::array<double, 3> moved{};
        for (std::size_t k = 0; k < rows.size(); ++k) {
            for (std::size_t j = 0; j < 3; ++j) {
                moved[j] += (rows[k].rate[j] - clean[k].rate[j]) / static_cast<double>(rows.size());
            }
        }
        add_noise(rows, random);
        const Assessment a = assess(settings, estimator::testing::result_of(rows));
        Eigen::VectorXd error(kParameters);
        for (std::size_t i = 0; i < kParameters; ++i) {
            const double truth = kTable2[i] + (i % kGroups == 0 ? moved[i / kGroups] : 0.0);
            error[static_cast<Eigen::Index>(i)] = a.coefficients[i].value - truth;
            const double in_u = error[static_cast<Eigen::Index>(i)] / a.coefficients[i].u_a;
            tally.rms += in_u * in_u;
            tally.within_2 += std::abs(in_u) <= 2 ? 1 : 0;
        }
        tally.nees += error.dot(a.covariance_a.llt().solve(error));
        ++(a.verdict.level == Level::valid      ? tally.valid
           : a.verdict.level == Level::doubtful ? tally.doubtful
                                                : tally.not_valid);
        if (::testing::Test::HasFailure()) break;
    }
    const double all = 30.0 * count;
    tally.rms = std::sqrt(tally.rms / all);
    tally.within_2 /= all;
    tally.nees /= count;
    return tally;
}

std::ostream& operator<<(std::ostream& out, const Tally& t) {
    return out << "rms " << t.rms << ", within 2 " << t.within_2 << ", NEES " << t.nees << ", "
               << t.valid << " V " << t.doubtful << " D " << t.not_valid << " N";
}

using estimator::testing::balanced;
using estimator::testing::balanced_with_rest;
using estimator::testing::sequential;
constexpr double kFirst = 6, kSecond = 14.0 / 3;

/// What 20 campaigns say, against rms of error/u_A of many.
void expect(const Tally& tally, double rms) {
    EXPECT_NEAR(tally.rms, rms, 0.15) << tally;
    EXPECT_LE(tally.rms, 1.2) << tally;
    EXPECT_GE(tally.within_2, 0.92) << tally;
    // Of 30 each: the mean of so many chi-squares, but once in 1000 times.
    const int count = tally.valid + tally.doubtful + tally.not_valid;
    EXPECT_NEAR(tally.nees, 30, 3.29 * std::sqrt(2 * 30.0 / count)) << tally;
}

TEST(Campaigns, OfACleanRigAreValid) {
    const std::uint64_t seed = 11;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Tally tally = campaigns(balanced(kFirst, kSecond), {}, 40, seed);
    expect(tally, 0.94);
    // One false alarm in 230 campaigns: two of 40 once in 80 times.
    EXPECT_GE(tally.valid, 38) << tally;
    const Tally rest = campaigns(balanced_with_rest(kFirst), {}, 20, seed);
    expect(rest, 0.98);
    EXPECT_GE(rest.valid, 19) << rest;
}

TEST(Campaigns, WhoseBiasStepsWalksDriftsOrScattersAreDoubtfulAndCoveredByU) {
    const std::uint64_t seed = 12;
    SCOPED_TRACE("seed " + std::to_string(seed));
    for (const auto& [levels, plan] : {std::pair{"9 and 7 g, ", balanced(kFirst, kSecond)},
                                       std::pair{"9 and 0 g, ", balanced_with_rest(kFirst)}}) {
        const auto run = [&, &plan = plan, levels = levels](const char* what,
                                                            const Misdeed& misdeed, double rms,
                                                            int most_not_valid) {
            SCOPED_TRACE(std::string(levels) + what);
            const Tally tally = campaigns(plan, misdeed, 20, seed);
            expect(tally, rms);
            EXPECT_LE(tally.valid, 1) << tally;
            EXPECT_LE(tally.not_valid, most_not_valid) << tally;
        };
        run("step 0.1 deg/h half way", step(0.1, 14), 1.0, 0);
        run("step 0.1 deg/h after dwell 6", step(0.1, 6), 1.0, 0);
        run("ramp 0.05 deg/h/h", ramp(0.05), 0.93, 0);
        run("walk 0.03 deg/h/sqrt(h)", walk(0.03), 0.93, 0);
        run("scatter 0.03 deg/h", scatter(0.03), 1.06, 4);
    }
}

TEST(Campaigns, InWhichARunFollowsTheOtherCannotTellAStepBetweenThem) {
    const auto plan = sequential(kFirst, kSecond);
    const Tally unknown = campaigns(plan, {}, 3, 13);
    EXPECT_EQ(unknown.doubtful, 3) << unknown;
    Settings settings;
    settings.drift.power = Power::unbroken;
    Rows rows = estimator::testing::theory_rows(settings, plan);
    Random random(13);
    add_noise(rows, random);
    const Assessment a = assess(settings, estimator::testing::result_of(rows));
    EXPECT_EQ(a.verdict.level, Level::valid) << a.verdict.sentence;
    EXPECT_GT(a.worst_step, 500);
}

/// Of clean rows, all gyros.
double weight_of_a_step(const std::vector<estimator::testing::PlannedRow>& plan, Power power) {
    Settings settings;
    settings.drift.power = power;
    Rows rows = estimator::testing::theory_rows(settings, plan);
    Random random(15);
    add_noise(rows, random);
    double sum = 0;
    for (const DriftAverage& gyro : assess(settings, estimator::testing::result_of(rows)).drift)
        sum += gyro.weights.step;
    return sum;
}

TEST(Campaigns, PowerPerRunIsABreakWhereALevelEndsButNotAtEachChangeOfAMixedOrder) {
    const auto mixed = balanced(kFirst, kSecond), plain = sequential(kFirst, kSecond);
    EXPECT_DOUBLE_EQ(weight_of_a_step(mixed, Power::per_run),
                     weight_of_a_step(mixed, Power::unknown));
    EXPECT_GT(weight_of_a_step(plain, Power::per_run),
              weight_of_a_step(plain, Power::unknown) + 0.3);
}

/// A step of gyro x after dwell 9 of a clean campaign, what the assessment makes of it.
DriftAverage stepped(double size, bool power_lost, Power power) {
    Settings settings;
    settings.drift.power = power;
    Rows rows = estimator::testing::theory_rows(settings, balanced(kFirst, kSecond));
    Random random(16);
    add_noise(rows, random);
    rows[9].after_power_loss = power_lost;
    for (std::size_t k = 9; k < rows.size(); ++k) rows[k].rate[0] += size;
    return assess(settings, estimator::testing::result_of(rows)).drift[0];
}

TEST(Campaigns, ARestartWithPowerLostIsABreakWhereAStepIsAsLikelyAsNot) {
    // GIVEN rows of which one is the first after a power loss WHEN nothing stepped
    const auto none = stepped(0, true, Power::unknown), unknown = stepped(0, false, Power::unknown);
    // THEN a step there is believed more than without, but less than its prior's half
    EXPECT_GT(none.weights.step, unknown.weights.step);
    EXPECT_LT(none.weights.step, 0.5);
    // WHEN a step of 2.5 sigma of a dwell is there, THEN it is placed where the power was lost
    const double size = 2.5 * std::sqrt(estimator::testing::kRateVariance);
    const auto lost = stepped(size, true, Power::unknown);
    EXPECT_EQ(lost.step.after_dwell, 9);
    EXPECT_GT(lost.step.weight, stepped(size, false, Power::unknown).step.weight + 0.2);
    // AND whoever states that the power was on all the time is believed
    EXPECT_DOUBLE_EQ(stepped(size, true, Power::unbroken).step.weight,
                     stepped(size, false, Power::unbroken).step.weight);
}

TEST(Campaigns, ADwellThatWasCutShortChangesNothingForTheOthers) {
    for (std::uint64_t seed = 31; seed <= 50; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Rows rows = estimator::testing::theory_rows({}, balanced(kFirst, kSecond));
        Random random(seed);
        add_noise(rows, random);
        const Assessment whole = assess({}, estimator::testing::result_of(rows));
        // GIVEN one dwell more, of 2 s: it knows next to nothing, and its rate is its noise
        DwellRow stub = rows.front();
        const double shorter = std::pow(100.0 / 2.0, 3);  // angle noise, spec 2
        stub.run = 3;
        stub.duration_s = 2;
        stub.middle_s = rows.back().middle_s + 100;
        mapped(stub.variance) *= shorter;
        mapped(stub.ramp_variance) *= shorter;
        rows.push_back(stub);
        // THEN each u is what it was: the unit of the drift's sizes is 1/29 of its square larger,
        // and with one dwell more the weights move as little
        const Assessment with = assess({}, estimator::testing::result_of(rows));
        for (std::size_t i = 0; i < kParameters; ++i)
            EXPECT_NEAR(with.coefficients[i].u / whole.coefficients[i].u, 1, 0.1) << i;
    }
}

/// Of angles that do not move in step: 0.12 arcsec is the rms of an encoder's lock-in over 100 s.
double sync_of_noise(Random& random) {
    double square = 0;
    for (int k = 0; k < 3; ++k)
        square += 0.12 * 0.12 * (std::exponential_distribution<double>()(random) - 1);
    return std::sqrt(std::max(0.0, square));
}

const Reason* reason_of(const Assessment& a, const std::string& code) {
    for (const Reason& reason : a.verdict.reasons)
        if (reason.code == code) return &reason;
    return nullptr;
}

TEST(Campaigns, ALineThatIsLeftAtRestIsNoMotionInStep) {
    Settings settings;
    for (const double left_g : {0.015, 0.03, 0.06, 0.13, 0.3, 0.5}) {
        const Rows clean = theory_rows(settings, balanced_with_rest(kFirst));
        for (int seed = 1; seed <= 20; ++seed) {
            SCOPED_TRACE(std::to_string(left_g) + " g, seed " + std::to_string(seed));
            Random random(static_cast<std::uint64_t>(seed));
            Rows rows = clean;
            for (DwellRow& row : rows) {
                row.sync_arcsec = sync_of_noise(random);
                if (row.frequency_hz > 0) continue;
                row.frequency_hz = 15;
                row.vibration.kappa = 1 + left_g * left_g / 2;
            }
            add_noise(rows, random);
            EXPECT_EQ(
                reason_of(assess(settings, estimator::testing::result_of(rows)), "sync motion"),
                nullptr);
            // THEN motion of the platform that is there is still seen, in a dwell of either level
            if (seed > 3) continue;
            for (const double kappa : {10.0, 1.0}) {
                Rows moved = rows;
                const auto one = std::ranges::find_if(moved, [=](const DwellRow& row) {
                    return kappa > 1 ? row.vibration.kappa > kappa : row.vibration.kappa < 2;
                });
                one->sync_arcsec = 20;
                const Assessment a =
                    assess(settings, estimator::testing::result_of(std::move(moved)));
                const Reason* reason = reason_of(a, "sync motion");
                ASSERT_NE(reason, nullptr) << kappa;
                EXPECT_EQ(reason->level, Level::not_valid) << kappa;
            }
        }
    }
}

TEST(Campaigns, HowLargeTheCoefficientsAreIsNoLackOfFit) {
    Settings settings;
    constexpr std::array<double, 3> kBias{40, -35, 30};  ///< deg/h, of a prior of 10
    const Rows small = theory_rows(settings, balanced(kFirst, kSecond));
    Rows large = small;
    for (DwellRow& row : large)
        for (std::size_t j = 0; j < 3; ++j) row.rate[j] += kBias[j] - kTable2[kGroups * j];
    Eigen::VectorXd prior(kParameters);
    for (Eigen::Index i = 0; i < prior.size(); ++i) prior[i] = i < 12 ? 0.01 : 1;
    const auto chi_square = [&](const Rows& rows) {
        return NullFit(dwell_table(rows), Eigen::MatrixXd(3 * rows.size(), 0), prior).chi_square();
    };
    double mean = 0;
    constexpr int kOfEach = 20;
    for (int seed = 1; seed <= kOfEach; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        const auto with_noise = [seed](Rows rows) {
            Random random(static_cast<std::uint64_t>(seed));
            add_noise(rows, random);
            return rows;
        };
        // The prior's part would be 16 + 12 + 9.
        EXPECT_NEAR(chi_square(with_noise(large)), chi_square(with_noise(small)), 0.01);
        const auto assessed = [&](const Rows& rows) {
            return assess(settings, estimator::testing::result_of(with_noise(rows)));
        };
        const Assessment a = assessed(large);
        EXPECT_EQ(a.degrees, 54);
        EXPECT_EQ(a.verdict.level, assessed(small).verdict.level) << a.verdict.sentence;
        mean += a.chi_square / kOfEach;
    }
    EXPECT_NEAR(mean, 54, 3.29 * std::sqrt(2 * 54.0 / kOfEach));
}

TEST(Campaigns, OfTheTwoStepRouteNothingIsTestedAndNothingCalledValid) {
    Settings settings;
    settings.method = Method::two_step;
    const Assessment a = assess(
        settings, estimator::testing::result_of(theory_rows(settings, balanced(kFirst, kSecond))));
    EXPECT_FALSE(a.done);
    EXPECT_EQ(a.verdict.level, Level::doubtful);
    EXPECT_NE(a.verdict.sentence.find("the two-step route tests nothing"), std::string::npos)
        << a.verdict.sentence;
}

TEST(CampaignsSoak, OfAThousandCleanOnesTenAreNotValidAtMost) {
    const std::uint64_t seed = 14;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Tally tally = campaigns(balanced(kFirst, kSecond), {}, 1000, seed);
    std::cout << "1000 clean campaigns, seed " << seed << ": " << tally << '\n';
    EXPECT_LE(tally.doubtful + tally.not_valid, 10) << tally;
    EXPECT_NEAR(tally.rms, 0.94, 0.05) << tally;
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
