#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "estimator/uncertainty/inputs_check.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::balanced;
using estimator::testing::result_of;
using estimator::testing::theory_rows;

Assessment of_clean_rig(const Settings& settings) {
    return assess(settings, result_of(theory_rows(settings, balanced(6, 14.0 / 3))));
}

/// Coefficients of one kind over the three gyros: bias, linear, squares, products.
std::size_t kind(std::size_t i) {
    const std::size_t group = internal_of(i) / kGyros;
    return group == kDt ? 0 : group <= kDo ? 1 : group <= kDoo ? 2 : 3;
}

/// rms of a contribution over a kind, in units of sigma; several elements of one input together.
std::array<double, 4> share(const Assessment& a, const std::string& input,
                            const std::string& begins = "") {
    std::array<double, 4> sum{}, count{};
    for (std::size_t i = 0; i < kParameters; ++i) {
        const Coefficient& c = a.coefficients[i];
        double square = 0;
        for (const Contribution& one : c.budget) {
            if (one.input == input && one.element.starts_with(begins))
                square += one.contribution * one.contribution;
        }
        sum[kind(i)] += square / (c.sigma * c.sigma);
        count[kind(i)] += 1;
    }
    for (std::size_t k = 0; k < 4; ++k) sum[k] = std::sqrt(sum[k] / count[k]);
    return sum;
}

TEST(Budget, OfACleanRigIsThatOfTheBalancedPlan) {
    const Assessment a = of_clean_rig({});
    const auto near = [&](const std::string& input, const std::array<double, 4>& expected,
                          const std::string& begins = "") {
        const std::array<double, 4> found = share(a, input, begins);
        for (std::size_t k = 0; k < 4; ++k)
            EXPECT_NEAR(found[k], expected[k], 0.0015 + 0.05 * expected[k])
                << input << " " << begins << " " << k;
    };
    near("latitude", {.025, .123, .023, .035});
    near("azimuth", {.015, .111, .073, .073});
    near("encoder_zero", {.013, .068, .037, .054});
    near("non_orthogonality", {.005, .039, .008, .019});
    near("resolver_harmonics", {.011, .044, .011, .029}, "1 per turn");
    near("resolver_harmonics", {.008, .069, .018, .061}, "2 per turn");
    near("resolver_harmonics", {.083, .414, .067, .116}, "16 per turn");
    near("time_base", {.005, .025, .005, .007});
    near("accelerometer_gain", {.022, .006, .662, .537});
    near("accelerometer_zero_g", {.002, .026, .008, .013});
    near("accelerometer_cross", {.001, .007, .021, .036});
    near("local_g", {0, .003, .001, .001});
}

/// 60 Hz and 1 ms between two accelerometers: (pi f tau)^2 = 0.0355 of the second moment, that is
/// half of it as a gain (docs/theory/spectrum.md), in a campaign at one frequency too.
TEST(Budget, SkewOfTheAccelerometersIsInIt) {
    const Settings settings;
    const double error = std::pow(std::numbers::pi * 60 * 1e-3, 2);
    EXPECT_NEAR(error, 0.0355, 1e-4);
    auto rows = theory_rows(settings, balanced(6, 14.0 / 3));
    const Assessment without = assess(settings, result_of(rows));
    EXPECT_EQ(share(without, "accelerometer_skew"), (std::array<double, 4>{}));
    for (auto& row : rows) {
        if (row.vibration.kappa > 1) row.relative_error = error;
    }
    const Assessment with = assess(settings, result_of(rows));
    const auto gain = share(with, "accelerometer_gain"), skew = share(with, "accelerometer_skew");
    const double ratio = error / 2 / settings.uncertainty.accelerometer_gain.u;
    for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(skew[k], ratio * gain[k], 1e-6 * skew[k]) << k;
    EXPECT_GT(skew[2], 1);
    for (std::size_t i = 0; i < kParameters; ++i)
        EXPECT_GE(with.coefficients[i].sigma, without.coefficients[i].sigma) << i;
}

TEST(Budget, AddsUpToTheCombinedUncertaintyWithTheLargestFirst) {
    const Assessment a = of_clean_rig({});
    for (const Coefficient& c : a.coefficients) {
        double square = 0, before = 1e9;
        for (const Contribution& one : c.budget) {
            EXPECT_LE(one.contribution, before);
            before = one.contribution;
            square += one.contribution * one.contribution;
        }
        EXPECT_NEAR(std::sqrt(square), c.u, 1e-9 * c.u);
        EXPECT_NEAR(c.expanded, c.k * c.u, 1e-12);
        EXPECT_TRUE(std::isnan(c.u_use));
    }
    // D_SSx of -0.030990 deg/h/g^2: the gain brings 2.90e-4; with k 1.96 for 95 %.
    const Coefficient& d = a.coefficients[6];
    EXPECT_NEAR(d.u, std::hypot(d.u_a, d.u_b), 1e-12);
    EXPECT_NEAR(d.k, 1.96, 0.01);
    EXPECT_EQ(d.budget[0].input, "noise and drift states");
    EXPECT_EQ(d.budget[1].input, "accelerometer_gain");
    EXPECT_NEAR(d.budget[1].contribution / std::abs(d.value), 2.90e-4 / 0.030990, 1e-4);
}

TEST(Budget, ADeclaredLatitudeIsNoMisfit) {
    // GIVEN a rig 6 arcmin from where it is thought to be
    Settings at;
    at.latitude_deg += 0.1;
    Settings believed;
    std::vector<DwellRow> rows = theory_rows(at, balanced(6, 14.0 / 3));
    const Kinematics true_site(at), site(believed);
    for (DwellRow& row : rows)
        mapped(row.rate) += true_site.pose(mapped(row.angles)).earth_rate -
                            site.pose(mapped(row.angles)).earth_rate;
    std::mt19937_64 random(5);
    estimator::testing::add_noise(rows, random);
    // WHEN it is declared as 10 arcsec, or as 6 arcmin
    const Assessment narrow = assess(believed, result_of(rows));
    believed.uncertainty.latitude_arcsec.u = 360;
    const Assessment wide = assess(believed, result_of(rows));
    // THEN that is a misfit by name and size, or none
    EXPECT_EQ(narrow.verdict.level, Level::not_valid) << narrow.verdict.sentence;
    EXPECT_NE(narrow.verdict.sentence.find("latitude 6."), std::string::npos)
        << narrow.verdict.sentence;
    EXPECT_LT(narrow.p, 1e-3);
    EXPECT_GT(wide.p, 1e-3);
    EXPECT_EQ(wide.verdict.level, Level::valid) << wide.verdict.sentence;
}

TEST(Budget, CorrelationsEnterAndImpossibleOnesAreRefused) {
    Settings settings;
    settings.uncertainty.correlations = {{"latitude", "azimuth", 0.9}};
    const Assessment with = of_clean_rig(settings), without = of_clean_rig({});
    double change = 0;
    for (std::size_t i = 0; i < kParameters; ++i)
        change =
            std::max(change, std::abs(with.coefficients[i].u_b / without.coefficients[i].u_b - 1));
    EXPECT_GT(change, 1e-3);
    // Parts and correlations add up to u: between two inputs, and two elements of one.
    settings.uncertainty.correlations.push_back({"encoder_zero.inner", "encoder_zero.outer", -0.7});
    const Assessment both = of_clean_rig(settings);
    for (std::size_t i = 0; i < kParameters; ++i) {
        const Coefficient& c = both.coefficients[i];
        double square = c.correlation;
        for (const Contribution& one : c.budget) square += one.contribution * one.contribution;
        EXPECT_NEAR(square, c.u * c.u, 1e-9 * c.u * c.u) << i;
        EXPECT_NE(c.correlation, 0) << i;
        EXPECT_NEAR(c.correlation_part() * std::abs(c.correlation_part()), c.correlation,
                    1e-12 * c.u * c.u);
        EXPECT_EQ(without.coefficients[i].correlation, 0);
    }

    const auto refused = [](std::vector<Correlation> list) {
        Inputs inputs;
        inputs.correlations = std::move(list);
        try {
            check(inputs);
        } catch (const SettingsError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(refused({{"latitude", "azimuth", 0.3}}), "");
    EXPECT_EQ(refused({{"latitude", "azimuth", 0.3}, {"latitude", "time_base", 0.3}}), "");
    for (const auto& again :
         {Correlation{"latitude", "azimuth", 0.3}, {"azimuth", "latitude", -0.3}})
        EXPECT_EQ(refused({{"latitude", "azimuth", 0.3}, again}),
                  "uncertainty.correlation: found '" + again.first + "' with '" + again.second +
                      "' twice, expected each pair once");
    EXPECT_NE(refused({{"latitude", "longitude", 0.3}}).find("'longitude'"), std::string::npos);
    EXPECT_NE(refused({{"latitude", "azimuth", 1.5}}).find("1.5"), std::string::npos);
    EXPECT_NE(refused({{"latitude", "azimuth", 0.9},
                       {"azimuth", "time_base", 0.9},
                       {"latitude", "time_base", -0.9}})
                  .find("exclude one another"),
              std::string::npos);
}

TEST(Budget, AStepBetweenRunsIsDeclaredWhereThePowerMayHaveBeenCutOnly) {
    const auto elements = [](const std::vector<estimator::testing::PlannedRow>& plan, Power power,
                             std::size_t lost = 0, std::size_t repeat = 0) {
        Settings settings;
        settings.drift.power = power;
        settings.uncertainty.bias_step_between_runs.u = 0.1;
        auto rows = theory_rows(settings, plan);
        if (lost > 0) rows[lost].after_power_loss = true;
        if (repeat > 0) rows[repeat].run = rows.front().run;
        std::vector<std::string> found;
        for (const InputSignature& input : assess(settings, result_of(rows)).inputs)
            if (input.input == "bias_step_between_runs") found.push_back(input.element);
        return found;
    };
    const auto mixed = balanced(6, 14.0 / 3), plain = estimator::testing::sequential(6, 14.0 / 3);
    const std::vector<std::string> none,
        half_way{"after dwell 14, x", "after dwell 14, y", "after dwell 14, z"},
        at_nine{"after dwell 9, x", "after dwell 9, y", "after dwell 9, z"};
    // Level by level: one place. Who declares a step says that power may be cut there.
    EXPECT_EQ(elements(plain, Power::per_run), half_way);
    EXPECT_EQ(elements(plain, Power::unknown), half_way);
    EXPECT_EQ(elements(plain, Power::unbroken), none);
    // A dwell of a former run is a place before it and one after it; it mixes no order.
    std::vector<std::string> around = half_way;
    for (const char* after : {"after dwell 20, ", "after dwell 21, "})
        for (const char axis : {'x', 'y', 'z'}) around.push_back(after + std::string(1, axis));
    EXPECT_EQ(elements(plain, Power::per_run, 0, 20), around);
    // Nobody switches the gyros off at each change of level of a mixed order.
    EXPECT_EQ(elements(mixed, Power::per_run), none);
    EXPECT_EQ(elements(mixed, Power::unknown), none);
    EXPECT_EQ(elements(mixed, Power::unknown, 9), at_nine) << "a power loss that was seen";
    EXPECT_EQ(elements(mixed, Power::unbroken, 9), none);
}

TEST(Budget, ForAnotherPowerOnTheSwitchingOnIsAdded) {
    Settings settings;
    settings.uncertainty.turn_on_bias = Declared{0.05};
    settings.uncertainty.turn_on_linear = Declared{0.01};
    const Assessment a = of_clean_rig(settings);
    EXPECT_GT(a.coefficients[0].u_use, 0.05);
    EXPECT_NEAR(a.coefficients[1].u_use, std::hypot(a.coefficients[1].u, 0.01), 1e-12);
    EXPECT_EQ(a.coefficients[4].u_use, a.coefficients[4].u);
}

TEST(Budget, ADeclaredRampWithinDwellsTakesThePlaceOfTheOneThatShows) {
    Settings settings;
    settings.uncertainty.turn_on_bias = Declared{0.05};
    settings.uncertainty.turn_on_linear = Declared{0.01};
    settings.uncertainty.ramp_in_dwell = Declared{0.12};
    const Coefficient bias = of_clean_rig(settings).coefficients[0];
    EXPECT_NEAR(bias.u_use, std::hypot(bias.u, 0.05, 0.12), 1e-12);
}

TEST(VerdictOfNothing, SaysWhatTookTheDwellsAndBlamesNoPositions) {
    const Settings settings;
    Result result;
    result.observable.fill(false);
    const auto sentence = [&] { return assess(settings, result).verdict.sentence; };
    EXPECT_NE(sentence().find("these positions and levels"), std::string::npos)
        << "no dwell at all";
    // GIVEN forces in m/s^2
    DwellSummary dwell;
    dwell.left_out = dwell.flagged = true;
    dwell.mean_force_g = 9.81;
    dwell.reason = "mean vertical specific force is not 1 g within 2 %: dwell rejected";
    result.dwells.assign(28, dwell);
    EXPECT_EQ(sentence(),
              "not valid, because no dwell is left to determine coefficients from: 28 of 28 are "
              "rejected, mean vertical specific force is not 1 g within 2 %: dwell rejected (it is "
              "9.81: are the forces in m/s^2?)");
    // GIVEN another reason for some
    for (auto& one : result.dwells) one.mean_force_g = 0.5;
    result.dwells.front().reason = "no samples";
    EXPECT_NE(sentence().find("28 of 28 are rejected, 27 of them: mean vertical"),
              std::string::npos)
        << sentence();
    EXPECT_EQ(sentence().find("m/s^2"), std::string::npos);
    // GIVEN dwells with nothing wrong that are all held out
    for (auto& one : result.dwells) one.left_out = one.flagged = false;
    EXPECT_EQ(sentence(),
              "not valid, because no dwell is left to determine coefficients from: all are held "
              "out or of another vibration");
    // GIVEN some that are kept, and most rejected
    result.rows = theory_rows(settings, estimator::testing::sequential(6, 14.0 / 3));
    for (std::size_t i = 0; i < 20; ++i) result.dwells[i].left_out = true;
    EXPECT_NE(sentence().find("; of the dwells, 20 of 28 are rejected"), std::string::npos)
        << sentence();
}

TEST(VerdictOnTheWay, WhatLaterDwellsWillDetermineIsNoReasonYet) {
    // GIVEN the first level of a plan that takes one level after the other
    const Settings settings;
    auto plan = estimator::testing::sequential(6, 14.0 / 3);
    plan.resize(plan.size() / 2);
    Result result = result_of(theory_rows(settings, plan));
    result.observable.fill(false);
    const auto says = [](const Assessment& a) {
        return std::ranges::any_of(a.verdict.reasons,
                                   [](const Reason& r) { return r.code == "not observable"; });
    };
    // THEN as long as it goes on that is no fault of the rig, and in the end it is
    const Assessment on_the_way = assess(settings, result, Stage::under_way);
    EXPECT_FALSE(says(on_the_way));
    EXPECT_NE(on_the_way.verdict.level, Level::not_valid) << on_the_way.verdict.sentence;
    const Assessment ended = assess(settings, result);
    EXPECT_TRUE(says(ended));
    EXPECT_EQ(ended.verdict.level, Level::not_valid);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
