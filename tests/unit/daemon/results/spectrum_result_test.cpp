#include "daemon/results/spectrum_result.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "daemon/results/assessment_json.hpp"
#include "daemon/results/spectrum_json.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::tool {
namespace {

using namespace estimator::spectrum::testing;
using estimator::DwellRow;
using estimator::spectrum::Form;
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

Assessed assessed(const std::vector<DwellRow>& rows, Form form = Form::automatic) {
    estimator::Settings settings = gain_declared();
    settings.frequency_hz = 15;
    settings.drift.power = estimator::uncertainty::Power::unbroken;
    estimator::Result result;
    result.rows = estimator::without_apart(rows);
    result.observable.fill(true);
    result.cross_check.done = true;
    return assess(settings, {}, result, rows, {}, form);
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

TEST(AssessOverFrequency, OneForAllOfARigThatResonatesIsOfNoFrequency) {
    const auto flat = assessed(rows_of(Truth::common(0.5, kSixty), 1), Form::flat);
    ASSERT_TRUE(flat.spectrum && flat.spectrum->analysis.flat.alarm);
    EXPECT_TRUE(std::isnan(flat.spectrum->at_hz(4)));
    EXPECT_EQ(flat.spectrum->at_hz(1), 0) << "a linear term knows no frequency";
    EXPECT_NE(flat.assessed.verdict.level, estimator::uncertainty::Level::valid);
    EXPECT_THAT(words_of(flat), HasSubstr("depend on the frequency, and are taken as flat"));
    // of a rig that does not, it is of each
    const auto even = assessed(rows_of(Truth::common(0, kSixty), 1), Form::flat);
    ASSERT_TRUE(even.spectrum && !even.spectrum->analysis.flat.alarm);
    EXPECT_EQ(even.spectrum->at_hz(4), 15);
    EXPECT_NE(even.assessed.verdict.level, estimator::uncertainty::Level::not_valid)
        << even.assessed.verdict.sentence;
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

TEST(AssessOverFrequency, ADwellOfAnotherFrequencyThatDoesNotFitIsDoubtfulAndTakenIntoU) {
    std::vector<DwellRow> rows = rows_of(Truth::common(0.5, kSixty), 1);
    EXPECT_THAT(words_of(assessed(rows)), Not(HasSubstr("do not fit coefficients of each")));
    // GIVEN a dwell in which gyro z drifted by 28 times the noise, not at the reference frequency
    std::ranges::find(rows, 45.0, &DwellRow::commanded_hz)->rate[2] += 0.2;
    const Assessed found = assessed(rows);
    // THEN that is said, of this frequency and gyro, and the coefficients are covered still
    EXPECT_EQ(found.assessed.verdict.level, estimator::uncertainty::Level::doubtful);
    EXPECT_THAT(words_of(found), HasSubstr("gyro z at 45 Hz least: taken into u"));
    EXPECT_LT(worst(found), 4);
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

TEST(AssessOverFrequency, WhatAllFrequenciesDetermineIsSaid) {
    // GIVEN coefficients that the first frequency alone does not determine
    const std::vector<DwellRow> rows = rows_of(Truth::common(0.5, kSixty), 1);
    estimator::Settings settings = gain_declared();
    settings.frequency_hz = 15;
    estimator::Result result;
    result.rows = estimator::without_apart(rows);
    result.observable.fill(true);
    result.observable[0] = result.observable[4] = false;
    const Assessed found = assess(settings, {}, result, rows, {});
    EXPECT_THAT(
        words_of(found),
        HasSubstr("do not determine one by one D_Fx D_IIx at the reference frequency; all "
                  "frequencies together determine D_Fx D_IIx, see the result's \"spectrum\""));
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
Assessed assessed_sites(double correlation) {
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

/// Once for all tests: under a sanitizer it is most of their time.
const Assessed& correlated_sites(double correlation) {
    static std::map<double, Assessed> all;
    const auto known = all.find(correlation);
    return known != all.end() ? known->second
                              : all.emplace(correlation, assessed_sites(correlation)).first->second;
}

TEST(AssessOverFrequency, ASensitivityDependsOnNoCorrelation) {
    const Assessed &with = correlated_sites(-0.99), &without = correlated_sites(0);
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
    const Assessed& found = correlated_sites(-0.99);
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

/// What read_model says of a file with this at a place of its `spectrum`.
std::string refusal_of(nlohmann::json file, const std::string& place, const nlohmann::json& value) {
    file["spectrum"][nlohmann::json::json_pointer(place)] = value;
    try {
        static_cast<void>(read_model(file, "file"));
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "taken";
}

TEST(ModelFile, WhatNoResultCanSayIsRefusedByItsKey) {
    // GIVEN a result as it is written
    nlohmann::ordered_json root;
    add_spectrum(*correlated_sites(0).spectrum, root);
    const nlohmann::json file = nlohmann::json::parse(root.dump());
    ASSERT_EQ(refusal_of(file, "/lowest_hz", 15.0), "taken");
    struct Case {
        const char* place;
        const char* value;
        const char* said;
    };
    // WHEN one value in it is impossible THEN its key, what it is and what it should be are said
    for (const auto& [place, value, said] : {
             Case{"/mixture/0/0/p/4/4", "-1",
                  "file: spectrum.mixture[0][0].p[4][4]: found -1, expected a variance of 0"},
             Case{"/mixture/0/0/p/4/5", "1e3", "p[5][4]: found"},
             Case{"/mixture/0/0/p", "[[1]]", "[0].p: found 1 entries, expected "},
             Case{"/mixture/0/0/p", "[]", "[0].p: found 0 entries, expected "},
             Case{"/mixture/0/0/p", "7", "[0].p: found 7, expected a list of "},
             Case{"/mixture/0/0/p/3", "[1, 2]", "[0].p[3]: found 2 entries, expected "},
             Case{"/mixture/0/0/p/3/3", "null", "[0].p[3][3]: found null, expected a number"},
             Case{"/mixture/0/0/x/4", "1e200", "[0].x[4]: found 1e+200, expected a number"},
             Case{"/mixture/0/0/x/4", "\"1\"", "[0].x[4]: found \"1\", expected a number"},
             Case{"/mixture/0/0/x", "[1, 2]", "[0].x: found 2 entries, expected "},
             Case{"/mixture/0/0/w", "1e300", "[0].w: found 1e+300, expected a number from 0 to 1"},
             Case{"/mixture/0/0/w", "0", "mixture[0]: found weights w of sum "},
             Case{"/mixture/0", "[]", "mixture[0]: found [], expected a list of hypotheses"},
             Case{"/mixture", "[]", "mixture: found 0 entries, expected 3"},
             Case{"/platform/up", "\"+q\"", "platform.up: found \"+q\", expected an axis"},
             Case{"/platform/gyro_axes/0", "[\"+x\", \"+x\", \"+z\"]",
                  "platform.gyro_axes[0]: found [\"+x\",\"+x\",\"+z\"], expected x, y and z once"},
             Case{"/platform/gyro_axes/0/1", "\"*y\"", "gyro_axes[0][1]: found \"*y\""},
             Case{"/platform/elevation_deg", "1e9",
                  "platform.elevation_deg: found 1000000000.0, expected a number from -2 to 2"},
             Case{"/platform/elevation_deg", "\"0\"",
                  "elevation_deg: found \"0\", expected a number"},
             Case{"/lowest_hz", "\"low\"", "file: spectrum.lowest_hz: found \"low\", expected"},
             Case{"/lowest_hz", "1e4", "spectrum.highest_hz: found "},
             Case{"/highest_hz", "1e9", "spectrum.highest_hz: found 1000000000.0, expected"},
             Case{"/effects/0/change/0", "[1]", "effects[0].change[0]: found 1 entries, expected "},
             Case{"/effects/0/input", "5", "effects[0].input: found 5, expected a text"},
             Case{"/effects_correlation", "[[0, \"1\", 2]]", "effects_correlation: found [0,"},
             Case{"/refusal", "5", "spectrum.refusal: found 5, expected a text or null"},
         }) {
        const std::string found = refusal_of(file, place, nlohmann::json::parse(value));
        EXPECT_THAT(found, HasSubstr(said)) << place;
        EXPECT_THAT(found, Not(HasSubstr("json.exception"))) << place;
    }
}

TEST(ModelFile, ACovarianceThatNoDataCanHaveIsRefused) {
    // GIVEN three coefficients whose pairs are possible, and all three together are not
    nlohmann::ordered_json root;
    add_spectrum(*correlated_sites(0).spectrum, root);
    nlohmann::json file = nlohmann::json::parse(root.dump());
    nlohmann::json& p = file["spectrum"]["mixture"][0][0]["p"];
    for (std::size_t i = 0; i < p.size(); ++i) {
        for (std::size_t j = 0; j < p.size(); ++j)
            p[i][j] = i == j ? 1.0 : i < 3 && j < 3 ? -0.9 : 0.0;
    }
    EXPECT_THAT(refusal_of(file, "/lowest_hz", 15.0),
                HasSubstr("mixture[0][0].p: found correlations with an eigenvalue of -0.8, "
                          "expected a positive semidefinite covariance"));
}

}  // namespace
}  // namespace vibrig::tool
