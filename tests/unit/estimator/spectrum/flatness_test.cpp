#include "estimator/spectrum/flatness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

#include "estimator/spectrum/analysis.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using namespace testing;

struct Alarms {
    unsigned with_f = 0, by_chi_square = 0, unfit = 0;
};
/// Dwells that scatter by 0.03 deg/h beside their noise.
Alarms of_scatter(double share, unsigned campaigns) {
    Alarms out;
    const Truth truth = Truth::common(share, kSixty);
    for (unsigned seed = 1; seed <= campaigns; ++seed) {
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal;
        auto plan = survey();
        shuffle(plan, random);
        Dwells dwells = dwells_of(undeclared(), truth, plan);
        add_noise(dwells, random);
        for (SpectralDwell& dwell : dwells.list)
            for (double& rate : dwell.row.rate) rate += 0.03 * normal(random);
        const Analysis found = analyse(
            undeclared(), SpectralTable(undeclared(), dwells.list, dwells.kinds), Form::flat);
        out.with_f += found.flat.alarm ? 1U : 0U;
        out.by_chi_square += found.flat.p < kAlarm ? 1U : 0U;
        out.unfit += found.fit.p < kAlarm ? 1U : 0U;
    }
    std::printf("scatter 0.03, share %g: p < 0.001 in %u, alarm in %u of %u\n", share,
                out.by_chi_square, out.with_f, campaigns);
    return out;
}

/// What scatter does to chi-square the F test takes out: 0.03 at most.
TEST(Flatness, ScatterNeedsAnFTestAsWell) {
    constexpr unsigned kCampaigns = 20;
    const Alarms flat = of_scatter(0, kCampaigns);
    EXPECT_LE(flat.with_f, at_most(kCampaigns, 0.03));
    // That the dwells scatter is seen each time: 19 times the noise's variance.
    EXPECT_EQ(flat.unfit, kCampaigns);
    constexpr unsigned kSeen = 6;
    EXPECT_EQ(of_scatter(0.05, kSeen).with_f, kSeen);
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
