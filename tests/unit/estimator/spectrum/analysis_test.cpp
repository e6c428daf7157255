#include "estimator/spectrum/analysis.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using namespace testing;

/// Rest twice at each of seven positions; of gyros x and z the one is off by 0.03 deg/h, the other
/// by as much the other way: no coefficients fit that, whatever they do over frequency.
Analysis of_contradictions(const Truth& truth, const std::vector<double>& further_hz) {
    // A constant bias: drift states would take it for their own.
    Settings settings = undeclared();
    settings.drift.model = uncertainty::BiasModel::constant;
    std::vector<PlannedDwell> plan;
    for (const PlannedDwell& one : survey()) {
        const bool wanted =
            one.hz <= 15 || std::ranges::find(further_hz, one.hz) != further_hz.end();
        if (!wanted) continue;
        plan.push_back(one);
        if (!(one.hz > 0)) plan.push_back(one);
    }
    std::mt19937_64 random(1);
    Dwells dwells = dwells_of(settings, truth, plan);
    add_noise(dwells, random);
    double sign = 1;
    for (SpectralDwell& dwell : dwells.list) {
        if (dwell.kind) continue;
        dwell.row.rate[0] += sign * 0.03;
        dwell.row.rate[2] += sign * 0.03;
        sign = -sign;
    }
    return analyse(settings, SpectralTable(settings, dwells.list, dwells.kinds), Form::automatic);
}

const std::vector<double> kAll{25, 35, 45, 65, 85, 125};

TEST(LackOfFit, OfFlatCoefficientsIsSaidAsSuchAfterTwoResonancesWereTried) {
    const Analysis found = of_contradictions({}, kAll);
    EXPECT_EQ(found.form, Form::flat);
    EXPECT_FALSE(found.second[0]);
    EXPECT_EQ(found.model.refusal,
              "gyro x, z: flat coefficients do not fit, one resonance is no likelier, and two do "
              "not fit either");
}

TEST(LackOfFit, OfFlatCoefficientsInFewDwellsIsNotBlamedOnAResonance) {
    const Analysis found = of_contradictions({}, {65});
    EXPECT_EQ(found.model.refusal,
              "gyro x, z: flat coefficients do not fit, one resonance is no likelier, and there "
              "are too few dwells for two (35, 40 are needed)");
}

TEST(LackOfFit, OfOneResonanceInFewDwellsSaysHowManyAreNeeded) {
    const Analysis found = of_contradictions(Truth::common(0.5, kSixty), {65});
    EXPECT_TRUE(found.gyros[0].named());
    EXPECT_EQ(found.model.refusal,
              "gyro x, z: one resonance does not fit, and there are too few dwells for two (35, 40 "
              "are needed)");
}

TEST(LackOfFit, OfTwoResonancesNamesEveryGyroWithItsOwnReason) {
    // Gyro z has no elastic part.
    Truth truth = Truth::common(0.5, kSixty);
    truth.elastic[2].clear();
    const Analysis found = of_contradictions(truth, kAll);
    EXPECT_EQ(found.model.refusal,
              "gyro x: more than two resonances; gyro z: flat coefficients do not fit, one "
              "resonance is no likelier, and two do not fit either");
}

TEST(Groups, AreRefusedForPredictions) {
    const Analysis found =
        campaign(undeclared(), Truth::common(0.5, kSixty), survey(), 1, true, Form::groups);
    EXPECT_EQ(found.form, Form::groups);
    EXPECT_EQ(found.model.refusal, "coefficients in groups know nothing between their frequencies");
    // Six for every frequency; the lowest one's stand where gravity's are.
    EXPECT_EQ(found.groups.value.rows(), 4 + 6 * 7);
}

TEST(Noise, IsAllOfWhatIsNotKnownWhereTheBiasStandsAndLessWhereItMoves) {
    Settings settings = undeclared();
    for (const bool stands : {true, false}) {
        settings.drift.model =
            stands ? uncertainty::BiasModel::constant : uncertainty::BiasModel::walk;
        settings.drift.walk_deg_h_rt_h = 0.1;
        std::mt19937_64 random(1);
        Dwells dwells = dwells_of(settings, {}, survey());
        add_noise(dwells, random);
        const Analysis found =
            analyse(settings, SpectralTable(settings, dwells.list, dwells.kinds), Form::flat);
        const Eigen::VectorXd share =
            found.noise.cwiseQuotient(found.covariance_a.diagonal().cwiseSqrt());
        EXPECT_LT(share.maxCoeff(), 1 + 1e-9);
        // Of 63 dwells a prior of deg/h is nothing; a bias that walks is most of what is not known
        // of its mean.
        if (stands)
            EXPECT_GT(share.minCoeff(), 0.999);
        else
            EXPECT_LT(share[0], 0.5);
    }
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
