#include "estimator/commissioning/gravity.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "tests/unit/estimator/commissioning/unknown_rig.hpp"

namespace vibrig::estimator::commissioning {
namespace {

using ::testing::HasSubstr;

TEST(Family, HasThirtyTwoMembersThatGravityCannotTellApart) {
    // GIVEN any description
    Description one;
    one.channel = {2, 0, 1};
    one.sign = {1, -1, -1};
    one.zero_deg = {31, -7, 110};
    one.elevation_deg = 0.7;
    one.accelerometers << 0.01, -1.01, 0, 0.99, 0.002, 0, 0.003, 0, 1;
    one.zero_g = {0.004, -0.002, 0.001};
    const auto family = family_of(one);
    ASSERT_EQ(family.size(), 32U);
    plant::Random random(4, 1);
    for (int n = 0; n < 20; ++n) {
        const Vec3 reading{360 * random.uniform(), 360 * random.uniform(), 360 * random.uniform()};
        for (const Description& other : family)
            EXPECT_NEAR((other.force(reading) - one.force(reading)).norm(), 0, 1e-12);
    }
    // THEN no two are the same, and halves have one handedness each
    for (std::size_t i = 0; i < family.size(); ++i) {
        EXPECT_EQ(family[i].accelerometers.determinant() > 0,
                  (one.accelerometers.determinant() > 0) == (i < 16));
        EXPECT_EQ(family[i].sign[0] * family[i].sign[1] * family[i].sign[2],
                  one.sign[0] * one.sign[1] * one.sign[2])
            << "the product of the signs is certain";
        for (std::size_t k = 0; k < i; ++k)
            EXPECT_TRUE(
                family[i].wiring() != family[k].wiring() || family[i].sign != family[k].sign ||
                std::abs(std::remainder(family[i].zero_deg[0] - family[k].zero_deg[0], 360.0)) > 1)
                << i << " and " << k;
    }
    // AND which accelerometer lies along the azimuth axis is certain
    for (const Description& other : family) {
        const Eigen::Vector3d along = other.wiring().col(2).cwiseAbs();
        EXPECT_EQ(along, Eigen::Vector3d(0, 0, 1));
    }
    EXPECT_EQ(preferred_of(one).sign[0], 1);
}

UnknownRig whole(std::uint64_t seed) {
    UnknownRig rig(seed);
    rig.travel_deg = {130, 30, 175};
    return rig;
}

TEST(Gravity, NeedsAPositionWithTheInnerGimbalTurned) {
    // GIVEN stops with all units known, as Table 1 has them: inner angle 0 everywhere
    UnknownRig rig = whole(3);
    auto stops = rig.stops();
    // WHEN the inner gimbal has stood still
    const auto inner = static_cast<std::size_t>(rig.channel[1]);
    for (Stop& stop : stops) stop.reading[inner] = stops.front().reading[inner];
    // THEN nothing is decided
    const auto found = find_by_gravity(stops);
    EXPECT_NE(found.verdict, Verdict::decided);
}

TEST(Gravity, RefusesWhatTheModelDoesNotDescribe) {
    // Of each kind 5 rigs: none is accepted.
    const auto refused = [](const char* kind, auto&& change) {
        for (std::uint64_t seed = 101; seed <= 105; ++seed) {
            UnknownRig rig = whole(seed);
            auto stops = rig.stops();
            change(rig, stops);
            const auto found = find_by_gravity(stops);
            EXPECT_NE(found.verdict, Verdict::decided) << kind << ", seed " << seed;
        }
    };
    refused("m/s^2", [](UnknownRig&, std::vector<Stop>& stops) {
        for (Stop& stop : stops)
            for (double& f : stop.force) f *= 9.81;
    });
    refused("one in m/s^2", [](UnknownRig&, std::vector<Stop>& stops) {
        for (Stop& stop : stops) stop.force[1] *= 9.81;
    });
    refused("two on one axis", [](UnknownRig&, std::vector<Stop>& stops) {
        for (Stop& stop : stops) stop.force[2] = stop.force[0];
    });
    refused("askew by 20 deg", [](UnknownRig&, std::vector<Stop>& stops) {
        for (Stop& stop : stops) stop.force[2] = 0.94 * stop.force[2] + 0.342 * stop.force[0];
    });
}

TEST(Gravity, BadInputIsRefusedByName) {
    auto stops = whole(1).stops();
    const auto said = [](const std::vector<Stop>& what) -> std::string {
        try {
            static_cast<void>(find_by_gravity(what));
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_THAT(said({}), HasSubstr("got 0 stops, expected 8 at least"));
    auto nan = stops;
    nan[3].force[1] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(said(nan), HasSubstr("not finite"));
    for (Stop& stop : stops)
        if (stop.swept == 1) stop.swept = -1;
    EXPECT_THAT(said(stops), HasSubstr("channel 1 has 0 stops"));
}

TEST(Gravity, NamesThePositionThatTellsTwoDescriptionsApart) {
    const auto found = find_by_gravity(whole(7).stops());
    ASSERT_EQ(found.verdict, Verdict::decided) << found.why;
    ASSERT_GE(found.hypotheses.size(), 2U);
    const auto between = separating_position(found.hypotheses[0].best, found.hypotheses[1].best,
                                             {{{0, 360}, {0, 360}, {0, 360}}});
    EXPECT_GT(between.by_g, 10e-3);
}

TEST(Earth, OneWitnessOfParityNeverSuffices) {
    // GIVEN a rig in the northern hemisphere, its outer axis towards north-east
    UnknownRig rig = whole(21);
    const auto found = find_by_gravity(rig.stops());
    ASSERT_EQ(found.verdict, Verdict::decided) << found.why;
    const Description named = preferred_of(found.hypotheses.front().best);
    const auto drifts = rig.drifts(named);
    const double latitude = rig.truth.latitude_deg;
    ASSERT_GT(std::abs(latitude), 20) << "of this seed";
    rig.stand_up();
    const Statements::Sense sense{rig.look().reading, rig.grows_anticlockwise()};
    // WHEN only one thing is known THEN it is undecided
    for (const Statements& said :
         {Statements{.latitude_deg = latitude}, Statements{.right_handed = rig.right_handed()},
          Statements{.sense = sense}})
        EXPECT_EQ(find_by_earth(named, drifts, said).verdict, Verdict::undecided);
    // WHEN two agree THEN it is decided, right
    const Statements two{.latitude_deg = latitude, .sense = sense};
    const auto decided = find_by_earth(named, drifts, two);
    ASSERT_EQ(decided.verdict, Verdict::decided) << decided.why;
    EXPECT_EQ(decided.description.accelerometers.determinant() > 0, rig.right_handed());
    // WHEN one of three is wrong THEN nothing is decided; of four it is outvoted and named
    const Statements one_of_three{
        .latitude_deg = -latitude, .right_handed = rig.right_handed(), .sense = sense};
    EXPECT_EQ(find_by_earth(named, drifts, one_of_three).verdict, Verdict::undecided);
    // WHEN the time is in minutes THEN that is said
    auto minutes = drifts;
    for (auto& drift : minutes)
        for (double& slope : drift.slope) slope *= 60;
    EXPECT_THAT(find_by_earth(named, minutes, two).why, HasSubstr("time in minutes"));
    // WHEN the latitude is another THEN both are shown
    Statements elsewhere = two;
    elsewhere.latitude_deg = latitude * 0.5;
    EXPECT_THAT(find_by_earth(named, drifts, elsewhere).why, HasSubstr("site.latitude_deg"));
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
