#include "estimator/spectrum/exposure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <random>

#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/profile_moments.hpp"
#include "tests/plant/elasticity.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using namespace testing;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kHalf = 0.5;
const Vector3d kGimbals = Vector3d(30, 10, -20) * (std::numbers::pi / 180);

/// Table 2 with half of every quadratic coefficient elastic, known without an error.
Model known() {
    Model model;
    model.lowest_hz = 15;
    model.highest_hz = 300;
    const ParameterArray all = table2();
    for (std::size_t j = 0; j < 3; ++j) {
        Hypothesis one{1, {kSixty}, Eigen::VectorXd(kColumns), {}};
        for (std::size_t g = 0; g < kGroups; ++g)
            one.x[static_cast<Index>(g)] = all[internal_index(g, j)];
        one.x.tail<kElastic>() = kHalf * one.x.segment<kElastic>(kBase - kElastic);
        one.covariance = Eigen::MatrixXd::Zero(kColumns, kColumns);
        model.mixture[j] = {one};
    }
    return model;
}

Situation under(const Profile& profile, double duration_s = 0) {
    Situation in{kGimbals, Matrix3d::Zero(),   bands_of(profile), duration_s,
                 false,    moments_of(profile)};
    for (const Matrix3d& moment : in.moments) in.moment += moment;
    return in;
}

TEST(Exposure, WhatIsCoherentAlongAxesIsTheSameAlongTheLine) {
    const Vector3d line(0.6, 0.64, 0.48);
    const Breakpoints density{{20, 0.05}, {100, 0.05}, {400, 0.002}};
    const auto times = [&](double factor) {
        Breakpoints out = density;
        for (auto& point : out) point.second *= factor;
        return out;
    };
    Profile axes{"axes", {}, {}, {0, 1, 0}, 0, {}};
    for (std::size_t k = 0; k < 3; ++k) axes.axes.psd[k] = times(std::pow(line[Index(k)], 2));
    axes.axes.cross = {times(line[0] * line[1]), times(line[0] * line[2]),
                       times(line[1] * line[2])};
    check(axes);
    const Profile along{"line", density, {}, {line[0], line[1], line[2]}, 0};
    ASSERT_NEAR(mean_square(axes), mean_square(along), 1e-12);
    Situation one = under(along, 100);
    one.moments.clear();
    const Model model = known();
    PredictionOptions options;
    const Prediction a = predict(model, {under(axes, 100)}, options),
                     b = predict(model, {one}, options);
    EXPECT_LT((a.drift - b.drift).norm(), 1e-11);
    EXPECT_LT((a.realisation - b.realisation).norm(), 1e-11);
    EXPECT_GT(b.realisation.minCoeff(), 1e-4);
    EXPECT_LT((a.outside - b.outside).norm(), 1e-11);
    EXPECT_GT(b.outside.minCoeff(), 1e-4);
    EXPECT_LT((a.vibration - b.vibration).norm(), 1e-11);
    EXPECT_NEAR(a.power_outside, b.power_outside, 1e-12);
}

/// Along up and north, with a cross-spectrum that changes its sign.
Profile two_axes() {
    Profile out{"two axes", {}, {}, {0, 1, 0}, 0, {}};
    out.axes.psd = {Breakpoints{{20, 0.02}, {200, 0.04}}, {{20, 0.05}, {200, 0.05}}, {}};
    out.axes.cross = {Breakpoints{{20, -0.03}, {200, 0.04}}, {}, {}};
    check(out);
    return out;
}

/// One realisation of the profile, line by line 1/T apart; north and up.
struct Realised {
    static constexpr double kTime = 4;
    std::vector<double> hz;
    std::vector<std::array<std::complex<double>, 2>> peak;

    Realised(const Profile& profile, std::mt19937_64& random) {
        std::normal_distribution<double> normal;
        const auto draw = [&] { return std::complex(normal(random), normal(random)); };
        const auto at = [](const Breakpoints& of, double f) {
            const double part = std::log(f / of[0].first) / std::log(of[1].first / of[0].first);
            if (of[0].second * of[1].second > 0)
                return of[0].second * std::pow(of[1].second / of[0].second, part);
            return of[0].second +
                   (of[1].second - of[0].second) * (f - of[0].first) / (of[1].first - of[0].first);
        };
        for (double f = 20 + 0.5 / kTime; f < 200; f += 1 / kTime) {
            const double nn = at(profile.axes.psd[0], f), uu = at(profile.axes.psd[1], f),
                         nu = at(profile.axes.cross[0], f);
            const auto first = draw(), second = draw();
            const double scale = 1 / std::sqrt(kTime);
            hz.push_back(f);
            peak.push_back(
                {scale * std::sqrt(nn) * first,
                 scale * (nu / std::sqrt(nn) * first + std::sqrt(uu - nu * nu / nn) * second)});
        }
    }

    /// What each line has of the second moment.
    [[nodiscard]] Situation situation() const {
        Situation in{kGimbals, Matrix3d::Zero(), {}, 0, false, {}};
        for (std::size_t k = 0; k < hz.size(); ++k) {
            Matrix3d moment = Matrix3d::Zero();
            for (Index a = 0; a < 2; ++a)
                for (Index b = 0; b < 2; ++b)
                    moment(a, b) = std::real(peak[k][static_cast<std::size_t>(a)] *
                                             std::conj(peak[k][static_cast<std::size_t>(b)])) /
                                   2;
            in.moments.push_back(moment);
            in.moment += moment;
        }
        for (std::size_t k = 0; k < hz.size(); ++k)
            in.bands.push_back({hz[k], in.moments[k].trace() / in.moment.trace(), 0});
        return in;
    }
};

/// The simulated rig's masses, integrated in time over one period of all lines (twice as long as
/// theirs, half a line off 0).
TEST(Exposure, TwoAxesAtOnceDriftAsMassesThatAreIntegratedInTime) {
    constexpr double kRate = 16000, kTime = 2 * Realised::kTime, kBefore = 1;
    std::mt19937_64 random(11);
    plant::Truth truth;
    truth.elastic_share = {kHalf, kHalf, kHalf};
    const ParameterArray all = table2();
    for (int seed = 0; seed < 3; ++seed) {
        const Realised drawn(two_axes(), random);
        const auto count = static_cast<std::size_t>((kTime + kBefore) * kRate);
        std::vector<plant::Shake> shakes(count + 1);
        for (std::size_t k = 0; k < drawn.hz.size(); ++k) {
            const auto turn = std::polar(1.0, 2 * std::numbers::pi * drawn.hz[k] / kRate);
            std::complex<double> phase = 1;
            for (plant::Shake& shake : shakes) {
                shake.in_phase += std::real(drawn.peak[k][0] * phase);
                shake.quadrature += std::real(drawn.peak[k][1] * phase);
                phase *= turn;
            }
        }
        plant::Elasticity masses(truth);
        const auto before = static_cast<std::size_t>(kBefore * kRate);
        static_cast<void>(masses.advance(kBefore, std::span(shakes).first(before + 1)));
        const auto whole = std::span(shakes).subspan(before);
        const auto excess = masses.advance(kTime, whole);
        double nn = 0, nu = 0, uu = 0;
        for (const plant::Shake& shake : whole.first(whole.size() - 1)) {
            nn += shake.in_phase * shake.in_phase / (kTime * kRate);
            nu += shake.in_phase * shake.quadrature / (kTime * kRate);
            uu += shake.quadrature * shake.quadrature / (kTime * kRate);
        }
        const auto moment = [](double a, double b, double c) {
            Matrix3d out = Matrix3d::Zero();
            out(0, 0) = a;
            out(0, 1) = out(1, 0) = b;
            out(1, 1) = c;
            return out;
        };
        const Prediction predicted = predict(known(), {drawn.situation()});
        const Attitude shaken = attitude({}, kGimbals, moment(nn, nu, uu));
        for (std::size_t j = 0; j < 3; ++j) {
            const Attitude more =
                attitude({}, kGimbals, moment(excess[j].pp, excess[j].pq, excess[j].qq));
            double drift = 0;
            for (std::size_t g = 0; g < kGroups; ++g)
                drift += shaken.base[j][static_cast<Index>(g)] * all[internal_index(g, j)];
            for (std::size_t q = 0; q < 6; ++q)
                drift += kHalf * more.vibration[j][static_cast<Index>(q)] *
                         all[internal_index(kDii + q, j)];
            EXPECT_NEAR(predicted.drift(0, static_cast<Index>(j)), drift, 2e-4) << "gyro " << j;
        }
    }
}

TEST(Exposure, RealisationsOfTwoAxesVaryAsPredicted) {
    constexpr int kDraws = 400;
    std::mt19937_64 random(12);
    const Model model = known();
    const Prediction predicted = predict(model, {under(two_axes(), Realised::kTime)});
    Eigen::MatrixXd drifts(kDraws, 3);
    for (int k = 0; k < kDraws; ++k)
        drifts.row(k) = predict(model, {Realised(two_axes(), random).situation()}).drift.row(0);
    for (Index j = 0; j < 3; ++j) {
        const double sigma = predicted.realisation(0, j);
        EXPECT_NEAR(drifts.col(j).mean(), predicted.drift(0, j), 4 * sigma / std::sqrt(kDraws))
            << j;
        const double ratio =
            (drifts.col(j).array() - predicted.drift(0, j)).square().mean() / (sigma * sigma);
        // 400 squares of nearly normal numbers: sqrt(2 / 400), four of them.
        EXPECT_NEAR(ratio, 1, 4 * std::sqrt(2.0 / kDraws)) << j;
    }
}

std::string axes_refusal(AxesPsd axes) {
    Profile profile{"", {}, {}, {0, 1, 0}, 0, {}};
    profile.axes = std::move(axes);
    try {
        check(profile, "p.json: ");
    } catch (const SettingsError& error) {
        return error.what();
    }
    return "";
}

TEST(Exposure, AxesThatCannotBeAreRefusedByPlace) {
    const Breakpoints flat{{20, 0.05}, {200, 0.05}};
    EXPECT_EQ(axes_refusal({{flat, flat, flat}, {}}), "");
    EXPECT_EQ(axes_refusal({{flat, flat, {}}, {flat, {}, {}}}), "");
    EXPECT_EQ(axes_refusal({{flat, {{20, 0.05}, {10, 0.05}}, {}}, {}}),
              "p.json: psd.up[1]: found 10 Hz after 20 Hz, expected growing frequencies");
    EXPECT_EQ(axes_refusal({{flat, flat, {}}, {Breakpoints{{20, std::nan("")}, {30, 0}}, {}, {}}}),
              "p.json: cross.north_up[0]: found nan g^2/Hz, expected a number");
    EXPECT_EQ(axes_refusal({{Breakpoints{}, Breakpoints{}, Breakpoints{{20, 0.05}}}, {}}),
              "p.json: psd.east: found 1 breakpoint, expected two or more");
    const auto too_much = [&](const AxesPsd& axes) {
        EXPECT_NE(axes_refusal(axes).find("p.json: cross: found "), std::string::npos);
    };
    too_much({{flat, flat, {}}, {Breakpoints{{20, 0.051}, {200, 0.051}}, {}, {}}});
    too_much({{flat, flat, {}},
              {Breakpoints{}, Breakpoints{}, flat}});  // with an axis that does not move
    // Each pair could be, all three together not: a b > 0, b c > 0, a c < 0.
    const Breakpoints most{{20, 0.04}, {200, 0.04}}, less{{20, -0.04}, {200, -0.04}};
    too_much({{flat, flat, flat}, {most, less, most}});
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
