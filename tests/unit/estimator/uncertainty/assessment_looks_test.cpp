// A verdict after each dwell is a look more, and a chance more to be wrong.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "estimator/filter/mapped.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::PlannedRow;
using estimator::testing::result_of;

/// Campaigns of which at least one look said so.
struct Looks {
    int not_valid = 0, not_simply_valid = 0;
};

/// `scale`: of the rates' variance for dwells of 100 s, in which encoders and gyros have their
/// part.
Looks look_after_each_dwell(const std::vector<PlannedRow>& plan, double scale, int campaigns,
                            std::uint64_t first_seed) {
    const Settings settings;
    Looks looks;
    for (int c = 0; c < campaigns; ++c) {
        std::mt19937_64 random(first_seed + static_cast<std::uint64_t>(c));
        auto rows = estimator::testing::theory_rows(settings, plan);
        for (DwellRow& row : rows) {
            mapped(row.variance) *= scale;
            mapped(row.ramp_variance) *= scale;
        }
        estimator::testing::add_noise(rows, random);
        Level worst = Level::valid;
        for (std::size_t n = 12; n < rows.size(); ++n) {
            const Assessment a = assess(
                settings, result_of({rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(n)}),
                Stage::under_way);
            if (a.degrees >= 9) worst = std::max(worst, a.verdict.level);
        }
        looks.not_valid += worst == Level::not_valid ? 1 : 0;
        looks.not_simply_valid += worst != Level::valid ? 1 : 0;
    }
    std::cout << campaigns << " clean campaigns, variance times " << scale << ", seeds from "
              << first_seed << ", a look after each dwell: not valid at one of them "
              << looks.not_valid << ", not valid or doubtful " << looks.not_simply_valid << '\n';
    return looks;
}

const double kTwoSeconds = std::pow(0.967 / 0.00699, 2);  ///< dwells of 2 s: their encoders' noise

TEST(Looks, OfAFewCleanCampaignsHardlyOneSaysNotValid) {
    // 10 of 1000 are allowed: two of 20 happen once in 60 times
    EXPECT_LE(look_after_each_dwell(estimator::testing::balanced(6, 14.0 / 3), 1, 20, 1).not_valid,
              1);
}

TEST(Looks, SoakOfAThousandCleanCampaignsTenOfWhichAreNotValidAtALookAtMost) {
    const auto mixed = estimator::testing::balanced(6, 14.0 / 3);
    const auto rest = estimator::testing::balanced_with_rest(6);
    EXPECT_LE(look_after_each_dwell(mixed, 1, 1000, 1).not_valid, 10);
    EXPECT_LE(look_after_each_dwell(rest, 1, 1000, 1001).not_valid, 10);
    EXPECT_LE(look_after_each_dwell(mixed, kTwoSeconds, 1000, 2001).not_valid, 10);
}

/// What the dwells so far make of an azimuth that is off, and all of them.
TEST(Looks, WhatIsWrongIsNotValidAsSoonAsTheOddsAreThatOfSoManyLooks) {
    const Settings settings;
    auto rows =
        estimator::testing::theory_rows(settings, estimator::testing::balanced(6, 14.0 / 3));
    std::mt19937_64 random(5);
    estimator::testing::add_noise(rows, random);
    ParameterArray truth{};
    const ForwardModel model(settings, truth);
    const auto off = signatures(Misfit::azimuth, dwell_table(rows), model, 0.007);
    for (std::size_t k = 0; k < rows.size(); ++k)  // 12 arcmin, the class counts in threes
        mapped(rows[k].rate) += 4 * off.z.block<3, 1>(static_cast<Eigen::Index>(3 * k), 0);
    int not_valid = 0;
    for (std::size_t n = 12; n < rows.size(); ++n) {
        const Assessment a = assess(
            settings, result_of({rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(n)}),
            Stage::under_way);
        if (a.verdict.level != Level::not_valid) continue;
        ++not_valid;
        EXPECT_GT(a.evidence.front().log_odds, 4 + std::log(1 + (a.degrees - 9) / 3))
            << a.verdict.sentence;
    }
    EXPECT_GE(not_valid, 5);
    EXPECT_EQ(assess(settings, result_of(rows)).verdict.level, Level::not_valid);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
