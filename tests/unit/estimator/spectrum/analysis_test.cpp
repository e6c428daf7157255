#include "estimator/spectrum/analysis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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

/// A survey with the bias still, where latitude and azimuth are known to 300 arcsec.
Analysis of_correlated_sites(double correlation, const std::string& other = "azimuth") {
    Settings settings = gain_declared();
    settings.drift.model = uncertainty::BiasModel::constant;
    settings.uncertainty.latitude_arcsec.u = settings.uncertainty.azimuth_arcsec.u = 300;
    settings.uncertainty.accelerometer_gain.u = 0.02;
    if (correlation != 0) settings.uncertainty.correlations = {{"latitude", other, correlation}};
    const Dwells dwells = dwells_of(settings, {}, survey());
    return analyse(settings, SpectralTable(settings, dwells.list, dwells.kinds), Form::flat);
}

const Effect& effect_of(const Analysis& of, const std::string& input) {
    return *std::ranges::find(of.model.effects, input, &Effect::input);
}

/// Of all 30, filter order.
Eigen::VectorXd on_all(const Effect& effect) {
    Eigen::VectorXd out(static_cast<Eigen::Index>(kParameters));
    for (std::size_t j = 0; j < kGyros; ++j)
        for (Eigen::Index a = 0; a < kBase; ++a)
            out[3 * a + static_cast<Eigen::Index>(j)] = effect.change[j][a];
    return out;
}

TEST(Declared, ACorrelationIsInTheCovarianceAndInNoSensitivity) {
    const double r = -0.99;
    const Analysis without = of_correlated_sites(0), with = of_correlated_sites(r);
    ASSERT_EQ(with.model.effects.size(), without.model.effects.size());
    for (std::size_t i = 0; i < with.model.effects.size(); ++i) {
        const Effect &a = with.model.effects[i], &b = without.model.effects[i];
        EXPECT_EQ(a.input + a.element, b.input + b.element);
        for (std::size_t j = 0; j < kGyros; ++j)
            EXPECT_LT((a.change[j] - b.change[j]).norm(), 1e-9 * b.change[j].norm() + 1e-15)
                << a.input << " " << a.element;
    }
    // C U C': of a pair r (c_a u_a c_b u_b' + its transpose).
    const Eigen::VectorXd a = on_all(effect_of(without, "latitude")),
                          b = on_all(effect_of(without, "azimuth"));
    const Eigen::MatrixXd expected =
        without.covariance + r * (a * b.transpose() + b * a.transpose());
    EXPECT_LT((with.covariance - expected).norm(), 1e-9 * expected.norm());
    EXPECT_GT((with.covariance - without.covariance).norm(), 0.01 * expected.norm());
}

TEST(Declared, APredictionHasTheCorrelationAndTheSameAccelerometersTakeTheirGainOutOnly) {
    Profile sine;
    sine.sines = {{55, 6}};
    const std::vector<Situation> in{situation_of(sine, {45, 0, 90}),
                                    situation_of(sine, {10, 60, 0})};
    const double r = 0.9;
    const Analysis without = of_correlated_sites(0),
                   with = of_correlated_sites(r, "accelerometer_gain");
    // What each does to the predictions, from what only one of them does.
    const auto only = [&](const std::string& input) {
        Model model = without.model;
        std::erase_if(model.effects, [&](const Effect& one) { return one.input != input; });
        Model none = model;
        none.effects.clear();
        return Eigen::MatrixXd(predict(model, in).covariance - predict(none, in).covariance);
    };
    const Eigen::MatrixXd gain = only("accelerometer_gain"), latitude = only("latitude"),
                          pair = predict(with.model, in).covariance -
                                 predict(without.model, in).covariance;
    ASSERT_GT(gain.diagonal().minCoeff(), 0);
    // The signs: what the drift does when the coefficients move as the input has it.
    const auto moved = [&](const std::string& input) {
        Model model = without.model;
        for (const Effect& one : model.effects) {
            if (one.input != input) continue;
            for (std::size_t j = 0; j < 3; ++j)
                model.mixture[j].front().x.head(one.change[j].size()) += one.change[j];
        }
        const Eigen::MatrixXd change = predict(model, in).drift - predict(without.model, in).drift;
        return Eigen::VectorXd(change.transpose().reshaped());  // element 3 k + j
    };
    const Eigen::VectorXd both = moved("accelerometer_gain").cwiseProduct(moved("latitude"));
    for (Eigen::Index i = 0; i < pair.rows(); ++i)
        EXPECT_NEAR(pair(i, i),
                    std::copysign(2 * r * std::sqrt(gain(i, i) * latitude(i, i)), both[i]),
                    1e-9 * gain(i, i) + 1e-16);
    // The gain goes, with what it has in common with others; the latitude stays.
    const PredictionOptions same{1, true};
    EXPECT_LT(
        (predict(with.model, in, same).covariance - predict(without.model, in, same).covariance)
            .norm(),
        1e-9 * gain.norm());
    // AND the parts add up to u
    const Prediction all = predict(with.model, in);
    for (Eigen::Index k = 0; k < 2; ++k) {
        for (Eigen::Index j = 0; j < 3; ++j) {
            double square = 0;
            for (const Eigen::MatrixXd* part :
                 {&all.coefficients, &all.resonance, &all.gain, &all.realisation, &all.outside})
                square += (*part)(k, j) * (*part)(k, j);
            EXPECT_NEAR(std::sqrt(square), all.u(k, j), 1e-9 * all.u(k, j));
        }
    }
}

TEST(AtFrequency, HasWhatIsNotKnownOfTwoResonances) {
    // Q(f) = Q_s + sum_r (rho_r(f) - 1) E_r, linearised in ln hz and ln damping of both.
    Hypothesis one{1, {{60, 0.05}, {95, 0.1}}, Eigen::VectorXd::Zero(22), {}, true};
    one.x[kBase - kElastic + 2] = 0.03;
    one.x[kBase + 2] = 0.015;
    one.x[kBase + kElastic + 2] = -0.01;
    const Eigen::Vector4d sigma(0.01, 0.02, 0.1, 0.2);
    one.covariance = Eigen::MatrixXd::Zero(26, 26);
    one.covariance(kBase + 2, kBase + 2) = 1e-6;
    one.covariance.diagonal().tail<4>() = sigma.cwiseAbs2();
    for (const double hz : {40.0, 57.0, 80.0}) {
        const auto value = [hz](double first, double second, double damped, double damped_second) {
            return 0.03 + 0.015 * (in_phase(hz, {first, damped}) - 1) -
                   0.01 * (in_phase(hz, {second, damped_second}) - 1);
        };
        const auto q = [&](const Eigen::Vector4d& ln) {
            return value(60 * std::exp(ln[0]), 95 * std::exp(ln[1]), 0.05 * std::exp(ln[2]),
                         0.1 * std::exp(ln[3]));
        };
        double square = std::pow(1e-3 * (in_phase(hz, {60, 0.05}) - 1), 2);
        for (Eigen::Index i = 0; i < 4; ++i) {
            const Eigen::Vector4d step = 1e-6 * Eigen::Vector4d::Unit(i);
            square += std::pow(sigma[i] * (q(step) - q(-step)) / 2e-6, 2);
        }
        const AtFrequency found = at_frequency({one}, 2, hz);
        EXPECT_NEAR(found.value, q(Eigen::Vector4d::Zero()), 1e-12) << hz;
        EXPECT_NEAR(found.sigma, std::sqrt(square), 1e-5 * std::sqrt(square)) << hz;
        EXPECT_EQ(at_frequency({one}, 3, hz).sigma, 0) << "another coefficient";
    }
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
