#include "daemon/results/spectrum_result.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/results/assessment_json.hpp"
#include "daemon/results/spectrum_json.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::tool {
namespace {

using namespace estimator::spectrum::testing;
using estimator::DwellRow;
using ::testing::HasSubstr;
using ::testing::Not;

/// Rows as a campaign has them: at rest and at 15 Hz its own, the others apart.
std::vector<DwellRow> rows_of(const Truth& truth, std::size_t surveys) {
    std::vector<PlannedDwell> plan;
    for (std::size_t i = 0; i < surveys; ++i)
        for (const PlannedDwell& one : survey()) plan.push_back(one);
    std::mt19937_64 random(3);
    Dwells dwells = dwells_of(gain_declared(), truth, plan);
    add_noise(dwells, random);
    std::vector<DwellRow> rows;
    for (std::size_t i = 0; i < plan.size(); ++i) {
        rows.push_back(dwells.list[i].row);
        rows.back().commanded_hz = plan[i].hz;
        rows.back().apart = plan[i].hz > 15;
    }
    return rows;
}

Assessed assessed(const std::vector<DwellRow>& rows) {
    estimator::Settings settings = gain_declared();
    settings.frequency_hz = 15;
    settings.drift.power = estimator::uncertainty::Power::unbroken;
    estimator::Result result;
    result.rows = estimator::without_apart(rows);
    result.observable.fill(true);
    result.cross_check.done = true;
    return assess(settings, {}, result, rows, {});
}

/// Largest distance from the static coefficients of the rig, in u.
double worst(const Assessed& found) {
    const auto truth = table2();
    double out = 0;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& c = found.assessed.coefficients[i];
        out = std::max(out, std::abs(c.value - truth[estimator::internal_of(i)]) / c.u);
    }
    return out;
}

std::string words_of(const Assessed& found) {
    std::string words;
    for (const auto& reason : found.assessed.verdict.reasons) words += reason.text + "; ";
    return words;
}

TEST(AssessOverFrequency, ACampaignHasTheStaticCoefficientsOfARigThatResonates) {
    const Truth truth = Truth::common(0.5, kSixty);
    // GIVEN all frequencies, or the first one alone
    const std::vector<DwellRow> rows = rows_of(truth, 1);
    const Assessed all = assessed(rows), one = assessed(estimator::without_apart(rows));
    ASSERT_TRUE(all.spectrum && all.assessed.over_frequency);
    EXPECT_FALSE(one.spectrum || one.assessed.over_frequency);
    // THEN the first has the rig's (30 values, one rig: 4 u is 1 in 500), and the other has not:
    // at 15 Hz elastic halves are 6.6 % more
    EXPECT_LT(worst(all), 4);
    EXPECT_EQ(all.spectrum->at_hz(4), 0) << "static";
    EXPECT_EQ(all.spectrum->at_hz(0), 0) << "a bias knows no frequency";
    // AND the parts of each U are of that fit
    for (const auto& c : all.assessed.coefficients) {
        double square = 0;
        for (const auto& part : c.budget) square += part.contribution * part.contribution;
        EXPECT_NEAR(square / (c.u * c.u), 1, 1e-9);
        EXPECT_LE(c.noise, c.u_a);
        EXPECT_NEAR(c.expanded, c.k * c.u, 1e-12);
    }
    EXPECT_EQ(all.assessed.rates.size(), rows.size());
    EXPECT_NE(all.assessed.coefficients[4].value, one.assessed.coefficients[4].value);
}

TEST(AssessOverFrequency, WhatCountsDwellsCountsThemAll) {
    const std::vector<DwellRow> rows = rows_of(Truth::common(0.5, kSixty), 1);
    const Assessed all = assessed(rows), one = assessed(estimator::without_apart(rows));
    // Ramps were fitted in the dwells of the first frequency alone.
    EXPECT_EQ(all.assessed.ramps.degrees, 3 * one.assessed.rates.size());
    // What is left of a rate has the declared gain in it, where it shook.
    for (const auto& rate : all.assessed.rates) {
        for (std::size_t j = 0; j < 3; ++j) {
            EXPECT_GE(rate.residual_sigma[j], rate.sigma[j] * (1 - 1e-12));
            if (rate.level_g > 1) {
                EXPECT_GT(rate.residual_sigma[j], 1.0001 * rate.sigma[j]);
            }
        }
    }
    EXPECT_THAT(all.assessed.verdict.sentence, HasSubstr("valid: 33 degrees of freedom"));
    EXPECT_THAT(all.assessed.verdict.sentence, HasSubstr("; over frequency: 63 dwells"));
    EXPECT_THAT(one.assessed.verdict.sentence, Not(HasSubstr("over frequency")));
}

TEST(AssessOverFrequency, MotionInStepIsLookedForAtAllFrequencies) {
    std::vector<DwellRow> rows = rows_of(Truth::common(0.5, kSixty), 1);
    EXPECT_THAT(words_of(assessed(rows)), Not(HasSubstr("in step")));
    // GIVEN 20 arcsec, at the highest frequency alone, and never at the first
    for (DwellRow& row : rows)
        if (row.commanded_hz == 125) row.sync_arcsec = 20;
    const Assessed found = assessed(rows);
    EXPECT_EQ(found.assessed.sync_arcsec, 20);
    EXPECT_THAT(words_of(found), HasSubstr("the angles move by 20.0 arcsec in step"));
    EXPECT_EQ(found.assessed.verdict.level, estimator::uncertainty::Level::not_valid);
    EXPECT_THAT(words_of(assessed(estimator::without_apart(rows))), Not(HasSubstr("in step")));
}

TEST(AssessOverFrequency, WhatIsFreedIsNotFreedThereAndTheVerdictSaysSo) {
    const std::vector<DwellRow> rows = rows_of(Truth::common(0.5, kSixty), 1);
    estimator::Settings settings = gain_declared();
    settings.frequency_hz = 15;
    settings.free = {estimator::uncertainty::Misfit::azimuth};
    estimator::Result result;
    result.rows = estimator::without_apart(rows);
    result.observable.fill(true);
    const Assessed found = assess(settings, {}, result, rows, {});
    EXPECT_EQ(found.assessed.verdict.level, estimator::uncertainty::Level::not_valid);
    EXPECT_THAT(words_of(found), HasSubstr("over frequency nothing is freed"));
}

TEST(AssessOverFrequency, MoreDwellsThanItTakesAreSaid) {
    // GIVEN 441 dwells at seven frequencies
    const std::vector<DwellRow> rows = rows_of({}, 7);
    ASSERT_GT(rows.size(), kMostSpectralDwells);
    const Assessed found = assessed(rows);
    // THEN nobody takes what stands for coefficients over frequency
    EXPECT_FALSE(found.spectrum);
    EXPECT_THAT(words_of(found), HasSubstr("of 441 dwells (400 at most)"));
    // AND of as many at one frequency nothing is said
    const Assessed one = assessed(estimator::without_apart(rows_of({}, 40)));
    EXPECT_THAT(words_of(one), Not(HasSubstr("at most")));
}

/// Of a survey: latitude and azimuth known to 300 arcsec each.
Assessed correlated_sites(double correlation) {
    const std::vector<DwellRow> rows = rows_of(Truth::common(0.5, kSixty), 1);
    estimator::Settings settings = gain_declared();
    settings.frequency_hz = 15;
    settings.uncertainty.latitude_arcsec.u = settings.uncertainty.azimuth_arcsec.u = 300;
    if (correlation != 0)
        settings.uncertainty.correlations = {{"latitude", "azimuth", correlation}};
    estimator::Result result;
    result.rows = estimator::without_apart(rows);
    result.observable.fill(true);
    result.cross_check.done = true;
    return assess(settings, {}, result, rows, {});
}

TEST(AssessOverFrequency, ASensitivityDependsOnNoCorrelation) {
    const Assessed with = correlated_sites(-0.99), without = correlated_sites(0);
    const auto sensitivity = [](const Assessed& of, std::size_t i, const std::string& input) {
        for (const auto& part : of.assessed.coefficients[i].budget)
            if (part.input == input) return part.sensitivity;
        return 0.0;
    };
    // The likeliest hypothesis may be another one in the mixture: 2 %.
    for (std::size_t i = 1; i < 4; ++i) {
        for (const char* input : {"latitude", "azimuth"}) {
            const double stated = sensitivity(without, i, input);
            EXPECT_NEAR(sensitivity(with, i, input), stated, 0.02 * std::abs(stated) + 1e-8)
                << input << " " << i;
        }
    }
    // AND parts and correlations add up to u, in the result as well
    for (const auto& c : with.assessed.coefficients) {
        double square = c.correlation;
        for (const auto& part : c.budget) square += part.contribution * part.contribution;
        EXPECT_NEAR(square / (c.u * c.u), 1, 1e-9);
        EXPECT_EQ(coefficient_json(c)["correlation_variance"], c.correlation);
    }
}

TEST(AssessOverFrequency, APredictionFromTheFileHasTheCorrelations) {
    const Assessed found = correlated_sites(-0.99);
    nlohmann::ordered_json root;
    add_spectrum(*found.spectrum, root);
    nlohmann::json file = nlohmann::json::parse(root.dump());
    EXPECT_EQ(file["spectrum"]["effects_correlation"], nlohmann::json::parse("[[0, 1, -0.99]]"));
    const std::vector<estimator::spectrum::Situation> in{
        situation_of(six_profiles().front(), {45, 0, 90})};
    const auto covariance = [&](const estimator::spectrum::Model& model) {
        return Eigen::MatrixXd(predict(model, in).covariance);
    };
    const Eigen::MatrixXd ours = covariance(found.spectrum->analysis.model);
    EXPECT_LT((covariance(read_model(file, "file")) - ours).norm(), 1e-12 * ours.norm());
    // A file of earlier versions has none.
    file["spectrum"].erase("effects_correlation");
    EXPECT_GT((covariance(read_model(file, "file")) - ours).norm(), 1e-6 * ours.norm());
    file["spectrum"]["effects_correlation"] = nlohmann::json::parse("[[0, 99, 0.5]]");
    try {
        static_cast<void>(read_model(file, "file"));
        ADD_FAILURE();
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("effects_correlation: found [0,99,0.5]"));
    }
}

}  // namespace
}  // namespace vibrig::tool
