#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "estimator/spectrum/resonance.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using namespace testing;

constexpr std::array<double, 3> kAngles{30, 10, -20};

TEST(SpectrumGolden, ColumnsOfASineAreAsPublished) {
    const Profile sine{"", {}, {{55, 6}}, {0, 1, 0}, 0};
    const Situation in = situation_of(sine, kAngles);
    const Attitude at = attitude({}, in.gimbal_rad, in.moment);
    const std::array<double, 6> elastic{9.530045833,  16.189968109, 41.053320908,
                                        12.421398396, 19.779788418, 25.780844755};
    for (std::size_t q = 0; q < 6; ++q)
        EXPECT_NEAR(elastic_weight(in.bands, kSixty) * at.vibration[0][static_cast<Index>(q)],
                    elastic[q], 2e-8);
    EXPECT_NEAR(at.base[0][4], 2.711724242, 1e-9);  // kappa 19
}

TEST(SpectrumGolden, DriftUnderASineAndUnderAProfileIsAsPublished) {
    const auto expect = [](const Profile& profile, double share, const std::array<double, 3>& is,
                           double within) {
        const Eigen::Vector3d drift =
            drift_of({}, Truth::common(share, kSixty), situation_of(profile, kAngles));
        for (std::size_t j = 0; j < 3; ++j)
            EXPECT_NEAR(drift[static_cast<Index>(j)], is[j], within) << profile.name;
    };
    const Profile sine{"sine", {}, {{55, 6}}, {0, 1, 0}, 0};
    expect(sine, 0.5, {0.706413286, -1.073163947, -0.226954174}, 2e-9);
    expect(sine, 0, {0.466849128, -0.453770430, 0.500133952}, 2e-9);
    const Profile& integrity = built_in_profiles()[0];
    // Bands of exact power: how they are cut moves the sixth digit.
    expect(integrity, 0.5, {0.547467650, -0.662209749, 0.255453067}, 5e-6);
    expect(integrity, 0, {0.762477489, -1.218118034, -0.397111583}, 5e-7);
}

/// As published: 1600 bands, each with its width times the density in its middle.
TEST(SpectrumGolden, MinimumIntegrityInItsPublishedBandsIsRightToTheLastDigit) {
    constexpr int kBands = 1600;
    Situation in = situation_of(built_in_profiles()[0], kAngles);
    in.bands.clear();
    double all = 0, in_phase_part = 0;
    for (int b = 0; b < kBands; ++b) {
        const auto edge = [](int i) { return 20 * std::pow(100, static_cast<double>(i) / kBands); };
        const double hz = std::sqrt(edge(b) * edge(b + 1)), width = edge(b + 1) - edge(b);
        const double power = width * 0.04 * (hz > 1000 ? std::pow(1000 / hz, 2) : 1);
        in.bands.push_back({hz, power, width});
        all += power;
        in_phase_part += power * in_phase(hz, kSixty);
    }
    for (Band& band : in.bands) band.share /= all;
    in.moment(1, 1) = all;
    EXPECT_NEAR(std::sqrt(all), 7.694154, 5e-7);
    EXPECT_NEAR(in_phase_part / all, -0.012320, 5e-7);
    const Eigen::Vector3d elastic = drift_of({}, Truth::common(0.5, kSixty), in),
                          flat = drift_of({}, {}, in);
    const Eigen::Vector3d published(0.547467650, -0.662209749, 0.255453067),
        published_flat(0.762477489, -1.218118034, -0.397111583);
    EXPECT_LT((elastic - published).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((flat - published_flat).cwiseAbs().maxCoeff(), 1e-9);
}

/// The survey with a deterministic error of gyro x.
struct GoldenSurvey : ::testing::Test {
    GoldenSurvey() {
        Dwells dwells = dwells_of({}, Truth::common(0.5, kSixty), survey());
        for (std::size_t i = 0; i < dwells.list.size(); ++i)
            dwells.list[i].row.rate[0] += 0.007 * std::sin(static_cast<double>(i) + 1);
        table.emplace(Settings{}, dwells.list, dwells.kinds);
        problem.rate.resize(63);
        for (Index k = 0; k < 63; ++k)
            problem.rate[k] = dwells.list[static_cast<std::size_t>(k)].row.rate[0];
        problem.covariance = 4.891201e-5 * MatrixXd::Identity(63, 63);
        problem.prior_sigma.resize(10);
        problem.prior_sigma << 10, 10, 10, 10, 1, 1, 1, 1, 1, 1;
    }
    std::optional<SpectralTable> table;
    GyroProblem problem;
};

TEST_F(GoldenSurvey, CoefficientsAtTheTrueResonance) {
    ASSERT_EQ(table->dwells(), 63);
    const MatrixXd g = gain(*table, 0, problem, {1, {kSixty}, {}, {}});
    const VectorXd x = g * problem.rate;
    const std::array<double, 16> golden{0.999913340, -1.001410420, 1.001236430, -0.996969629,
                                        0.030020452, -0.030050154, 0.029975146, -0.030089251,
                                        0.029932939, -0.030143279, 0.015043643, -0.014997036,
                                        0.015003411, -0.014943471, 0.015198178, -0.015175545};
    for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(x[static_cast<Index>(i)], golden[i], 1e-7);
    const VectorXd left = problem.rate - design(*table, 0, {kSixty}) * x;
    EXPECT_NEAR(left.squaredNorm() / 4.891201e-5, 21.053960, 1e-3);
    const std::array<double, 6> u{6.5824e-5,  8.6311e-5,  6.6127e-5,
                                  1.03915e-4, 1.77117e-4, 1.03915e-4};
    // Independent rates of one variance: u of a gain is the root of its square.
    for (std::size_t q = 0; q < 6; ++q)
        EXPECT_NEAR(std::sqrt(4.891201e-5) * g.row(10 + static_cast<Index>(q)).norm(), u[q], 1e-8);
}

TEST_F(GoldenSurvey, MixtureFindsTheResonance) {
    const Mixture found = one_resonance(*table, 0, problem);
    ASSERT_TRUE(found.resonant());
    const Told told = tell(found).at(0);
    EXPECT_NEAR(told.hz.mean, 59.993, 0.02);
    EXPECT_NEAR(told.hz.sigma, 0.152, 0.02);
    EXPECT_NEAR(told.damping.mean, 0.0502, 0.0003);
    EXPECT_NEAR(told.damping.sigma, 0.0016, 0.0003);
    // Well determined, so normal: 95 % lie within 1.96 sigma.
    EXPECT_NEAR(told.hz.low, 59.993 - 1.96 * 0.152, 0.02);
    EXPECT_NEAR(told.hz.high, 59.993 + 1.96 * 0.152, 0.02);
    EXPECT_NEAR(told.damping.low, 0.0502 - 1.96 * 0.0016, 0.0005);
    EXPECT_NEAR(told.damping.high, 0.0502 + 1.96 * 0.0016, 0.0005);
    EXPECT_GT(found.log_odds, 600);
    EXPECT_LE(found.list.size(), 300U);
    EXPECT_EQ(found.degrees, 45);

    const Hypothesis flat = without_resonance(*table, 0, problem);
    const VectorXd left = problem.rate - design(*table, 0, {}) * flat.x;
    EXPECT_NEAR(left.squaredNorm() / 4.891201e-5, 139186.926, 1e-2);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
