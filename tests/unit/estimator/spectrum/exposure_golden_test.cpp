#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
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

}  // namespace
}  // namespace vibrig::estimator::spectrum
