// What the dwells of a campaign say of the configuration that they were identified with.
#include "estimator/commissioning/contradiction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <optional>

#include "estimator/filter/angles.hpp"
#include "tests/plant/recording.hpp"
#include "tests/plant/simulation.hpp"

namespace vibrig::estimator::commissioning {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// `spoil`: of the dwell, from 0.
using Spoil = std::function<void(std::size_t dwell, Measurement&)>;

/// Of `positions` dwells; `to`: the dwell as it is told to the filter.
Contradiction found(const Settings& settings, std::size_t positions,
                    const std::function<void(DwellInfo&)>& to = {}, const Spoil& spoil = {}) {
    plant::Truth truth;
    truth.seed = 11;
    plant::CampaignPlan plan;
    plan.dwell_s = 20;
    Identification identification(settings);
    DwellInfo info{1, 1};
    const auto begin = [&] {
        if (to) to(info);
        identification.begin_dwell(info);
    };
    std::size_t dwells = 0;
    begin();
    plant::simulate(
        truth, plan,
        [&](const plant::PlannedSample& sample) {
            if (dwells == positions) return;
            Measurement m;
            m.time_s = sample.time_s;
            for (std::size_t k = 0; k < 3; ++k) {
                m.angle_rad[k] = sample.readings.encoder_deg[k] * kRadPerDeg;
                m.force_g[k] = sample.readings.raw_g[k];
            }
            if (spoil) spoil(dwells, m);
            static_cast<void>(identification.add(m));
        },
        [&](std::size_t, std::size_t) {
            if (dwells == positions) return;
            static_cast<void>(identification.end_dwell());
            if (++dwells == positions) return;
            info = {dwells < 14 ? 1 : 2, static_cast<int>(dwells % 14) + 1};
            begin();
        });
    const Result result = identification.result();
    EXPECT_THAT(identification.means(), SizeIs(result.dwells.size()));
    auto of = contradiction_of(settings, result.dwells, identification.means());
    EXPECT_EQ(first_contradiction(settings, result.dwells, identification.means()), of.first);
    return of;
}

TEST(Contradiction, IsNotFoundWhereTheConfigurationIsTheRigs) {
    const auto of = found({}, 28);
    EXPECT_EQ(of.first, "");
    EXPECT_THAT(of.warnings, IsEmpty());
}

TEST(Contradiction, IsNoneWhereOneDwellIsSpoiled) {
    // GIVEN one dwell in which a resolver stands still from a third of it on
    std::optional<double> begin_s;
    double still = 0;
    const auto stuck = [&](std::size_t dwell, Measurement& m) {
        if (dwell != 5) return;
        if (!begin_s) begin_s = m.time_s;
        if (m.time_s - *begin_s < 7) still = m.angle_rad[1];
        m.angle_rad[1] = still;
    };
    EXPECT_EQ(found({}, 28, {}, stuck).first, "");
    EXPECT_TRUE(begin_s);
    // OR one accelerometer that ends at 2 g, beyond which the platform goes
    bool cut = false;
    const auto clipped = [&cut](std::size_t dwell, Measurement& m) {
        if (dwell != 12) return;
        cut = cut || m.force_g[1] > 2;
        m.force_g[1] = std::min(m.force_g[1], 2.0);
    };
    EXPECT_EQ(found({}, 28, {}, clipped).first, "");
    EXPECT_TRUE(cut);
}

TEST(Contradiction, OfAFewAttitudesAloneIsNotPutDownToZeros) {
    Settings settings;
    settings.encoder_zero_deg = {2, 0, 0};
    // At one attitude three zeros would explain anything.
    for (const auto& words : found(settings, 1).warnings)
        EXPECT_THAT(words, ::testing::Not(HasSubstr("accelerometer.zero_g")));
}

TEST(Contradiction, OfAnAccelerometersZeroShowsInOneDwell) {
    Settings settings;
    settings.accelerometer_zero_g = {0, 0, 0.015};  // 0.86 deg
    const auto of = found(settings, 1);
    EXPECT_THAT(of.first, HasSubstr("mean force 0.8"));
    ASSERT_THAT(of.warnings, SizeIs(2));
    EXPECT_EQ(of.warnings[0], "configuration and recording do not fit: " + of.first);
}

TEST(Contradiction, OfAnAccelerometersZeroNamesIt) {
    Settings settings;
    settings.accelerometer_zero_g = {0, 0, 0.015};
    const auto of = found(settings, 14);
    ASSERT_THAT(of.warnings, SizeIs(2));
    // The rig has none: what is named is 0 within what 14 dwells know of it.
    std::array<double, 3> zero{1, 1, 1};
    ASSERT_EQ(std::sscanf(of.warnings[1].c_str(),
                          "suspects, best first: accelerometer.zero_g: about [%lf, %lf, %lf]",
                          &zero[0], &zero[1], &zero[2]),
              3)
        << of.warnings[1];
    for (const double z : zero) EXPECT_NEAR(z, 0, 1e-3);
}

TEST(Contradiction, NamesTheKeyThatWouldExplainIt) {
    Settings settings;
    settings.encoder_sign = {-1, 1, 1};
    const auto of = found(settings, 28);
    ASSERT_NE(of.first, "");
    EXPECT_THAT(of.warnings.back(), HasSubstr("suspects, best first: platform.encoder_sign: 1 "
                                              "instead of -1 of the outer"));
}

TEST(Contradiction, NamesTheUnitOfTheAnglesAndOfTheTime) {
    // GIVEN radians in columns of degrees
    const auto radians = found({}, 28, {}, [](std::size_t, Measurement& m) {
        for (double& angle : m.angle_rad) angle = std::remainder(angle, 2 * kPi) * kRadPerDeg;
    });
    EXPECT_THAT(radians.warnings.back(), HasSubstr("alpha_deg, beta_deg, gamma_deg: in radians"));
    // OR from 0 to a whole turn, at whose ends the readings of a dwell jump
    const auto turns = found({}, 28, {}, [](std::size_t, Measurement& m) {
        for (double& angle : m.angle_rad) {
            angle = std::remainder(angle, 2 * kPi);
            angle = (angle < 0 ? angle + 2 * kPi : angle) * kRadPerDeg;
        }
    });
    EXPECT_THAT(turns.warnings.back(), HasSubstr("alpha_deg, beta_deg, gamma_deg: in radians"));
    // OR those of one gimbal
    const auto of = [](std::size_t k) {
        return found({}, 28, {}, [k](std::size_t, Measurement& m) {
            m.angle_rad[k] = std::remainder(m.angle_rad[k], 2 * kPi) * kRadPerDeg;
        });
    };
    EXPECT_THAT(of(0).warnings.back(), HasSubstr("first: alpha_deg: in radians"));
    EXPECT_THAT(of(2).warnings.back(), HasSubstr("first: gamma_deg: in radians"));
    // OR times twice as long, or half
    const auto twice = found({}, 28, {}, [](std::size_t, Measurement& m) { m.time_s *= 2; });
    EXPECT_THAT(twice.warnings.back(), HasSubstr("time_s: it is in units of 0.5 s"));
    const auto half = found({}, 28, {}, [](std::size_t, Measurement& m) { m.time_s /= 2; });
    EXPECT_THAT(half.warnings.back(), HasSubstr("time_s: it is in units of 2 s"));
}

TEST(Contradiction, DoesNotPutAnEncodersZeroDownToRadians) {
    Settings settings;
    settings.encoder_zero_deg = {2, 0, 0};
    for (const std::size_t dwells : {1U, 2U, 14U})
        for (const auto& words : found(settings, dwells).warnings)
            EXPECT_THAT(words, ::testing::Not(HasSubstr("radians")));
}

TEST(Contradiction, AsksNoDwellThatIsApartAndNoSweep) {
    Settings settings;
    settings.accelerometer_zero_g = {0, 0, 0.015};
    EXPECT_EQ(found(settings, 3, [](DwellInfo& dwell) { dwell.held_out = true; }).first, "");
    // Also where it is left out: it shakes with another frequency than it says.
    EXPECT_EQ(found(settings, 3, [](DwellInfo& dwell) { dwell.frequency_hz = 35; }).first, "");
    EXPECT_EQ(found(settings, 3, [](DwellInfo& dwell) { dwell.sweep.to_hz = 100; }).first, "");
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
