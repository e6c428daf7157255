#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <map>
#include <numbers>

#include "tests/unit/estimator/commissioning/unknown_rig.hpp"

namespace vibrig::estimator::commissioning {
namespace {

/// What people say of a rig, some of it wrong.
Statements said_of(UnknownRig& rig, bool& wrong) {
    auto& random = rig.random;
    const auto lies = [&](double share) {
        const bool lie = random.uniform() < share;
        wrong = wrong || lie;
        return lie;
    };
    Statements said;
    said.latitude_deg = (lies(0.01) ? -1 : 1) * rig.truth.latitude_deg;
    if (random.uniform() >= 0.4)
        said.compass_deg =
            rig.truth.azimuth_deg + 15 * (2 * random.uniform() - 1) + (lies(0.01) ? 90 : 0);
    if (random.uniform() >= 0.3) said.right_handed = rig.right_handed() != lies(0.01);
    rig.stand_up();
    if (random.uniform() >= 0.05)
        said.sense = Statements::Sense{rig.look().reading, rig.grows_anticlockwise() != lies(0.02)};
    return said;
}

/// Largest error of the force forecast over the travel, g.
double forecast_error(const UnknownRig& rig, const Description& found, plant::Random& random) {
    double worst = 0;
    for (int n = 0; n < 10; ++n) {
        const plant::Vec3 at{360 * random.uniform(), 60 * (random.uniform() - 0.5),
                             360 * random.uniform()};
        const auto force = rig.force_at(at);
        const auto forecast = found.force(rig.reading_at(at));
        for (std::size_t i = 0; i < 3; ++i)
            worst = std::max(worst, std::abs(force[i] - forecast[static_cast<int>(i)]));
    }
    return worst;
}

/// Empty: the names of channels, units and the product of the signs are the rig's.
std::string wrong_names(const UnknownRig& rig, const Description& found) {
    if (found.channel != rig.channel) return "channels";
    int product = 1;
    for (std::size_t i = 0; i < 3; ++i) {
        product *= found.sign[i] * rig.sign[i];
        const double degrees = angle_units()[static_cast<std::size_t>(found.unit[i])].degrees;
        if (std::abs(degrees / rig.degrees[i] - 1) > 1e-9) return "units";
    }
    return product == 1 ? "" : "signs";
}

struct Tally {
    int decided = 0, wrong = 0, undecided = 0, refused_dead = 0, stuck = 0, parity = 0;
    double worst_forecast_g = 0, least_ratio = 1e300, worst_azimuth_deg = 0;
};

void commission(std::uint64_t seed, Tally& tally) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    UnknownRig rig(seed);
    const double fate = rig.random.uniform();
    const auto which = static_cast<std::size_t>(3 * rig.random.uniform());
    if (fate < 0.05) rig.dead = which;
    if (fate >= 0.05 && fate < 0.08) rig.stuck = which;
    rig.by_hand = rig.random.uniform() < 0.15;
    bool lied = false;
    const auto found = find_by_gravity(rig.stops());
    if (rig.dead) {
        ++tally.refused_dead;
        EXPECT_EQ(found.verdict, Verdict::refused);
        EXPECT_NE(found.why.find(std::string("accelerometer.") + "xyz"[which]), std::string::npos)
            << found.why;
        return;
    }
    if (rig.stuck) {
        ++tally.stuck;
        EXPECT_EQ(found.verdict, Verdict::undecided);
        EXPECT_NE(found.why.find("channel " + std::to_string(rig.channel[which] + 1)),
                  std::string::npos)
            << found.why;
        return;
    }
    EXPECT_EQ(found.verdict, Verdict::decided) << found.why;
    if (found.verdict != Verdict::decided) {
        ++tally.undecided;
        return;
    }
    const auto& best = found.hypotheses.front();
    EXPECT_EQ(wrong_names(rig, best.best), "");
    EXPECT_FALSE(found.second_person) << best.rms_g;
    tally.least_ratio = std::min(tally.least_ratio, -found.hypotheses.at(1).ln_ratio);
    const double error = forecast_error(rig, best.best, rig.random);
    tally.worst_forecast_g = std::max(tally.worst_forecast_g, error);
    const Description named = preferred_of(best.best);
    const auto drifts = rig.drifts(named);
    const auto earth = find_by_earth(named, drifts, said_of(rig, lied));
    if (earth.verdict != Verdict::decided) {
        ++tally.parity;
        return;
    }
    ++tally.decided;
    // Whichever parity gravity began with: named as the bus names them, as far as that goes.
    const Description bus_names = preferred_of(earth.description);
    EXPECT_EQ(earth.description.wiring(), bus_names.wiring());
    EXPECT_EQ(earth.description.sign, bus_names.sign);
    const bool right = (earth.description.accelerometers.determinant() > 0) == rig.right_handed();
    // Counted about the other end of the outer axis, azimuth + 180.
    const double turned = earth.description.sign[0] == rig.sign[0] ? 0 : 180;
    const double azimuth =
        std::abs(std::remainder(earth.rate.azimuth_deg() - rig.truth.azimuth_deg - turned, 360.0));
    const double latitude = std::abs(earth.rate.latitude_deg() - std::abs(rig.truth.latitude_deg));
    if (!right || wrong_names(rig, best.best) != "" || azimuth > 2) {
        ++tally.wrong;
        ADD_FAILURE() << "azimuth off by " << azimuth << " deg, right parity " << right
                      << ", somebody was wrong: " << lied;
    }
    if (std::abs(rig.truth.latitude_deg) > 15) {
        EXPECT_LT(latitude, 1.5) << "latitude";
        tally.worst_azimuth_deg = std::max(tally.worst_azimuth_deg, azimuth);
    }
    const double elevation =
        std::abs(std::abs(earth.description.elevation_deg) - std::abs(rig.truth.base_tilt_deg[1]));
    EXPECT_LT(elevation, 0.06);
}

/// A rig whose axes and accelerometers are what the bus names them.
TEST(RandomRigs, AsTheBusNamesItIsFoundFromEitherParity) {
    Description truth;
    truth.sign = {1, -1, 1};
    truth.zero_deg = {30, 5, -60};
    const auto family = family_of(truth);
    // WHEN the drawing and the sense say so THEN whichever member gravity has found it is that one
    const Vec3 reading{30, 5, -60};
    Statements said;
    said.right_handed = true;
    said.sense = Statements::Sense{{120, 5, -60}, false};
    for (const Description& member : family) {
        for (const bool upper : {true, false}) {
            said.sense->reading[0] = upper ? 120 : -60;
            said.sense->grew = -truth.sign[2] * truth.up(said.sense->reading)[2] > 0;
            const auto found = find_by_earth(preferred_of(member), {}, said);
            ASSERT_EQ(found.verdict, Verdict::decided) << found.why;
            EXPECT_EQ(found.description.wiring(), Eigen::Matrix3d::Identity());
            EXPECT_EQ(found.description.sign, truth.sign);
            for (int k = 0; k < 3; ++k)
                EXPECT_NEAR(found.description.angles(reading)[k], 0, 1e-12) << k;
        }
    }
}

TEST(RandomRigs, AreNamedRightOrNotAtAll) {
    Tally tally;
    constexpr int kRigs = 1000;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) commission(seed, tally);
    std::printf(
        "of %d: %d decided, %d wrong, %d by gravity undecided, %d dead, %d stuck, %d parity; "
        "worst forecast %.2f mg, least ln ratio %.0f, worst azimuth %.2f deg\n",
        kRigs, tally.decided, tally.wrong, tally.undecided, tally.refused_dead, tally.stuck,
        tally.parity, 1e3 * tally.worst_forecast_g, tally.least_ratio, tally.worst_azimuth_deg);
    EXPECT_EQ(tally.wrong, 0);
    EXPECT_EQ(tally.undecided, 0);
    EXPECT_LE(tally.stuck + tally.parity, kRigs / 10);
    // 25 are asked; forces are forecast to what gimbals that are 2' off square leave
    EXPECT_GE(tally.least_ratio, 25);
    EXPECT_LT(tally.worst_forecast_g, 4e-3);
    EXPECT_LT(tally.worst_azimuth_deg, 1.5);
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
