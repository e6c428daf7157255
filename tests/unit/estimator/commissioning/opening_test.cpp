#include "estimator/commissioning/opening.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "estimator/filter/encoder_angles.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/plant/random.hpp"

namespace vibrig::estimator::commissioning {
namespace {

using plant::operator*;
using ::testing::IsEmpty;

constexpr double kToRad = std::numbers::pi / 180;

/// Where a configuration brings the simulated rig, whose encoders count as its gimbals do, and what
/// is read there.
std::vector<DwellMean> rest_of(const plant::Truth& truth, const Settings& as, std::uint64_t seed) {
    const plant::PlatformModel model(truth);
    plant::Random random(seed, 5);
    std::vector<DwellMean> stops;
    const auto stand = [&](const std::array<double, 3>& gimbals, bool drifts) {
        const plant::Vec3 angle = kToRad * encoder_deg(as, gimbals);
        DwellMean stop;
        stop.encoder_rad = angle;
        stop.force_g = model.up_at(angle);
        for (double& f : stop.force_g) f += 3e-4 * random.normal();
        const auto rate = model.angle_rates(angle, 0, {});
        for (std::size_t i = 0; i < 3; ++i)
            stop.slope_deg_h[i] = rate[i] / kToRad * 3600 + 0.02 * random.normal();
        stop.level_known = drifts;
        stops.push_back(stop);
    };
    for (const auto& gimbals : kOpeningDrifts_deg) stand(gimbals, true);
    stand(kOpeningGravity_deg, false);
    return stops;
}

/// A rig with drift as gyros have it.
plant::Truth usual(plant::Random& random) {
    plant::Truth truth;
    truth.azimuth_deg = 180 * (2 * random.uniform() - 1);
    for (auto& skew : truth.non_orthogonality_arcsec) skew = 60 * random.normal();
    for (auto& gyro : truth.coefficients)
        for (std::size_t term = 0; term < plant::kTerms; ++term)
            gyro[term] = random.normal() * (term == 0 ? 2 : term < plant::kII ? 1 : 0.03);
    return truth;
}

Settings site_of(const plant::Truth& truth) {
    Settings settings;
    settings.latitude_deg = truth.latitude_deg;
    settings.azimuth_deg = truth.azimuth_deg;
    return settings;
}

struct WrongAtRest {
    const char* name;
    std::function<void(Settings&)> change;
    const char *key, *more;
};

class Opened : public ::testing::TestWithParam<WrongAtRest> {};

TEST_P(Opened, AWrongKeyIsRefusedAndAmongTheFirstThreeSuspects) {
    for (std::uint64_t seed = 1; seed <= 24; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        plant::Random random(seed, 8);
        plant::Truth truth = usual(random);
        truth.latitude_deg = (seed % 2 == 0 ? 1 : -1) * (40 + 20 * random.uniform());
        Settings settings = site_of(truth);
        GetParam().change(settings);
        const auto stops = rest_of(truth, settings, seed);
        const auto found = hold_at_rest(settings, stops);
        EXPECT_THAT(found.refused, ::testing::Not(IsEmpty()));
        std::vector<std::string> named;
        for (const auto& suspect : suspects_at_rest(settings, stops))
            named.push_back(suspect.words);
        EXPECT_TRUE(std::ranges::any_of(named,
                                        [](const std::string& words) {
                                            return words.starts_with(GetParam().key) &&
                                                   words.find(GetParam().more) != std::string::npos;
                                        }))
            << testing::PrintToString(named) << testing::PrintToString(found.refused);
    }
}

/// As the table in docs/commissioning.md.
INSTANTIATE_TEST_SUITE_P(
    Keys, Opened,
    ::testing::Values(
        WrongAtRest{"InnerSign", [](Settings& s) { s.encoder_sign[1] = -1; },
                    "platform.encoder_sign: 1 instead of -1", "inner"},
        WrongAtRest{"OuterSign", [](Settings& s) { s.encoder_sign[0] = -1; },
                    "platform.encoder_sign: 1 instead of -1", "outer"},
        WrongAtRest{"AzimuthSign", [](Settings& s) { s.encoder_sign[2] = -1; },
                    "platform.encoder_sign: 1 instead of -1", "azimuth"},
        WrongAtRest{"OuterZero", [](Settings& s) { s.encoder_zero_deg[0] = 5; },
                    "platform.encoder_zero_deg", "of the outer"},
        WrongAtRest{"InnerZero", [](Settings& s) { s.encoder_zero_deg[1] = 5; },
                    "platform.encoder_zero_deg", "of the inner"},
        WrongAtRest{"AzimuthZero", [](Settings& s) { s.encoder_zero_deg[2] = 5; },
                    "platform.encoder_zero_deg", "of the azimuth"},
        WrongAtRest{"Swapped",
                    [](Settings& s) {
                        s.accelerometer_matrix = {{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}};
                    },
                    "accelerometer.matrix", "are +y, +x, +z"},
        WrongAtRest{"Inverted",
                    [](Settings& s) {
                        s.accelerometer_matrix = {{{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
                    },
                    "accelerometer.matrix", "are -x, -y, -z"},
        WrongAtRest{"Up",
                    [](Settings& s) {
                        s.up = {2, 1};
                    },
                    "platform.up", "+y instead of +z"},
        WrongAtRest{"LatitudeSign", [](Settings& s) { s.latitude_deg = -s.latitude_deg; },
                    "site.latitude_deg", ""},
        WrongAtRest{"Latitude", [](Settings& s) { s.latitude_deg += 5; }, "site.latitude_deg", ""},
        WrongAtRest{"Azimuth90", [](Settings& s) { s.azimuth_deg += 90; }, "site.azimuth_deg", ""},
        WrongAtRest{"Azimuth180", [](Settings& s) { s.azimuth_deg -= 180; }, "site.azimuth_deg",
                    ""}),
    [](const auto& wrong) { return std::string(wrong.param.name); });

TEST(Opening, TimeInMinutesIsNamed) {
    auto stops = rest_of({}, {}, 22);
    for (auto& stop : stops)
        for (double& slope : stop.slope_deg_h) slope *= 60;
    EXPECT_THAT(hold_at_rest({}, stops).refused, ::testing::Not(IsEmpty()));
    const auto suspected = suspects_at_rest({}, stops);
    ASSERT_FALSE(suspected.empty());
    EXPECT_EQ(suspected.front().words, "time_s: it is in minutes");
}

TEST(Opening, RefusesNoRightRigAndTellsOfFew) {
    // GIVEN 200 rigs with drift as gyros have it, on bases that lean, described as they
    // are THEN none is refused, and few have a warning
    int warned = 0;
    double chi2 = 0;
    for (std::uint64_t seed = 1; seed <= 200; ++seed) {
        plant::Random random(seed, 9);
        plant::Truth truth = usual(random);
        truth.latitude_deg = 75 * (2 * random.uniform() - 1);
        truth.base_tilt_deg = {0, 2 * random.uniform() - 1};
        Settings settings = site_of(truth);
        settings.elevation_deg = truth.base_tilt_deg[1];  // as commissioning finds it
        const auto found = hold_at_rest(settings, rest_of(truth, settings, seed));
        EXPECT_THAT(found.refused, IsEmpty()) << "seed " << seed;
        warned += found.warned.empty() ? 0 : 1;
        chi2 += found.rest_chi2 / 200;
    }
    EXPECT_LE(warned, 2);
    EXPECT_NEAR(chi2, 7, 1.5);  // 7 degrees of freedom: sd of the mean 0.26, and the skewed axes
}

TEST(Opening, DriftsThatAreAllAtOnePlaceAreRefused) {
    // GIVEN gimbals that are commanded to turn, say that they are there, and stand still
    auto stops = rest_of({}, {}, 24);
    for (std::size_t i = 1; i < 4; ++i) stops[i] = stops[0];
    const auto found = hold_at_rest({}, stops);
    EXPECT_THAT(found.refused,
                ::testing::Contains(::testing::HasSubstr("not those of the positions")));
}

TEST(Opening, SaysNothingOfTheEarthWithTwoDrifts) {
    Settings settings;
    settings.azimuth_deg = 90;
    auto stops = rest_of({}, settings, 23);
    stops.erase(stops.begin(), stops.begin() + 2);
    const auto found = hold_at_rest(settings, stops);
    EXPECT_FALSE(found.earth_known);
    EXPECT_THAT(found.refused, IsEmpty());
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
