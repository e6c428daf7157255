#include "estimator/commissioning/torques.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/unit/estimator/commissioning/unknown_rig.hpp"

namespace vibrig::estimator::commissioning {
namespace {

using Eigen::Matrix3d;
using ::testing::HasSubstr;

constexpr std::uint64_t kRigs = 24;
constexpr double kTorque = 60, kArcmin = 180 * 60 / std::numbers::pi;

/// A rig whose gravity and parity are decided, and what its torquers do.
struct Rig {
    explicit Rig(std::uint64_t seed) : unknown(seed) {
        unknown.travel_deg = {130, 30, 175};
        const auto gravity = find_by_gravity(unknown.stops());
        EXPECT_EQ(gravity.verdict, Verdict::decided) << gravity.why;
        const Description named = preferred_of(gravity.hypotheses.front().best);
        const auto drifts = unknown.drifts(named);
        Statements said;  // the drawing, and a sense that agrees with it: the right parity
        said.right_handed = unknown.right_handed();
        said.latitude_deg = unknown.truth.latitude_deg;
        unknown.stand_up();
        said.sense = Statements::Sense{unknown.look().reading, unknown.grows_anticlockwise()};
        const auto earth = find_by_earth(named, drifts, said);
        EXPECT_EQ(earth.verdict, Verdict::decided) << earth.why;
        found = earth.description;
        rate = earth.rate;
    }

    /// `response`: truth's platform rate over the command.
    [[nodiscard]] std::vector<Torqued> torqued(const Matrix3d& response) {
        return torqued(response, response);
    }
    [[nodiscard]] std::vector<Torqued> torqued(const Matrix3d& above, const Matrix3d& below) {
        unknown.go({45, 0, 45});
        std::vector<Torqued> all{{{}, unknown.drift()}};
        for (int k = 0; k < 3; ++k) {
            for (const int way : {1, -1}) {
                Vec3 command{};
                command[static_cast<std::size_t>(k)] = way * kTorque;
                const Eigen::Vector3d turn = way * kTorque * (way > 0 ? above : below).col(k);
                all.push_back({command, unknown.drift({turn[0], turn[1], turn[2]})});
            }
        }
        return all;
    }

    /// Truth's platform axes of those found: a signed permutation but for errors.
    [[nodiscard]] Matrix3d truth_of_found(const Description& d) const {
        Matrix3d truth;
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                truth(i, k) =
                    unknown
                        .accelerometers[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)];
        return truth.inverse() * d.accelerometers;
    }
    /// By how much those found are turned about z, within the quarter turn that names them.
    [[nodiscard]] double turned_arcmin(const Description& d) const {
        const Matrix3d p = truth_of_found(d);
        // A mirrored z counts the other way round.
        return std::remainder(std::atan2(p(1, 0), p(0, 0)), std::numbers::pi / 2) * kArcmin;
    }

    UnknownRig unknown;
    Description found;
    EarthRate rate;
};

Matrix3d diagonal(double x, double y, double z) { return Eigen::Vector3d(x, y, z).asDiagonal(); }

TEST(Torquers, SignScaleAndAxisAreFoundOnRandomRigs) {
    double before = 0, after = 0;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Rig rig(seed);
        plant::Random random(seed, 9);
        const auto drawn = [&random] {
            return (random.uniform() < 0.5 ? -1 : 1) * (1 + 0.04 * (2 * random.uniform() - 1));
        };
        const Matrix3d truth = diagonal(drawn(), drawn(), drawn());
        const auto drifts = rig.torqued(truth);
        // By the torquers' names the platform's axes are the truth's, whatever the accelerometers
        // are called.
        const auto f = named_by_torquers(rig.found, rig.rate, drifts);
        ASSERT_EQ(f.verdict, Verdict::decided) << f.why;
        ASSERT_TRUE(f.named());
        const Matrix3d p = rig.truth_of_found(f.description);
        for (std::size_t k = 0; k < 3; ++k) {
            const auto i = static_cast<int>(k);
            EXPECT_GT(std::abs(p(i, i)), 0.9) << "the axis of its own name";
            EXPECT_EQ(f.sign[k], (truth(i, i) > 0) == (p(i, i) > 0) ? 1 : -1) << k;
            // 0.1 % of noise; axes 2' off square make 0.1 % more.
            EXPECT_NEAR(f.scale[k], std::abs(truth(i, i)), 5e-3);
        }
        // Gravity is forecast as before.
        const Vec3 reading = rig.unknown.look().reading;
        EXPECT_LT((f.description.force(reading) - rig.found.force(reading)).norm(), 1e-9);
        before += std::pow(rig.turned_arcmin(rig.found), 2);
        after += std::pow(rig.turned_arcmin(f.description), 2);
    }
    // The accelerometers' misalignments are 10', the gimbals' 2' off square, the torquers' noise
    // 1'.
    EXPECT_GT(std::sqrt(before / kRigs), 4);
    EXPECT_LT(std::sqrt(after / kRigs), 4);
}

TEST(Torquers, ASwapIsSeenAndNoNamingMendsOneWithTheAzimuthAxis) {
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Rig rig(seed);
        const Matrix3d p = rig.truth_of_found(rig.found).array().round();
        Matrix3d swap;
        swap << 0, 1, 0, 1, 0, 0, 0, 0, 1;
        // As the accelerometers name the axes found, X and Y turn each other's.
        const auto xy = find_by_torque(rig.found, rig.rate, rig.torqued(p * swap));
        ASSERT_EQ(xy.verdict, Verdict::decided) << xy.why;
        EXPECT_EQ(xy.axis, (std::array<int, 3>{1, 0, 2}));
        EXPECT_FALSE(xy.named());
        swap << 0, 0, 1, 0, 1, 0, 1, 0, 0;
        const auto xz = named_by_torquers(rig.found, rig.rate, rig.torqued(p * swap));
        ASSERT_EQ(xz.verdict, Verdict::decided) << xz.why;
        EXPECT_FALSE(xz.named());
        EXPECT_EQ(xz.axis, (std::array<int, 3>{2, 1, 0}));
    }
}

TEST(Torquers, WhatIsDeadOneSidedOrOutOfScaleIsRefusedAndNamed) {
    struct Case {
        Matrix3d above, below;
        const char* why;
    };
    Matrix3d same = Matrix3d::Identity();
    same.col(0) = same.col(1);
    const std::array cases{
        Case{diagonal(1, 0, 1), diagonal(1, 0, 1), "command Y turns nothing"},
        Case{diagonal(1, 1, 0.03), diagonal(1, 1, 0.03), "command Z turns nothing"},
        Case{diagonal(1, 1, 1), diagonal(0, 1, 1),
             "command X: 1.00 of the rate commanded one way, 0.00 the other"},
        Case{diagonal(2.2, 1, 1), diagonal(2.2, 1, 1), "command X: 2.20 of"},
        Case{diagonal(1, -0.45, 1), diagonal(1, -0.45, 1), "command Y: 0.45 of"},
        Case{diagonal(1, 1, 1), diagonal(1, 1, -1), "command Z turns the platform the same way"},
        Case{same, same, "commands X and Y both turn platform axis"}};
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        Rig rig(seed);
        const Matrix3d p = rig.truth_of_found(rig.found).array().round();
        for (const Case& one : cases) {
            const auto f =
                named_by_torquers(rig.found, rig.rate, rig.torqued(p * one.above, p * one.below));
            EXPECT_EQ(f.verdict, Verdict::refused) << "seed " << seed << ", " << one.why;
            EXPECT_THAT(f.why, HasSubstr(one.why)) << "seed " << seed;
        }
    }
}

TEST(Torquers, WhatIsOddIsReportedAndWhatNoDescriptionFitsIsRefused) {
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Rig rig(seed);
        const Matrix3d p = rig.truth_of_found(rig.found).array().round();
        // 12 % off: a warning. 4 % off: none, five times the noise away from 5 %.
        auto f = find_by_torque(rig.found, rig.rate, rig.torqued(p * diagonal(1.12, 1, -0.96)));
        ASSERT_EQ(f.verdict, Verdict::decided) << f.why;
        ASSERT_FALSE(f.warnings.empty());
        EXPECT_THAT(f.warnings[0], HasSubstr("command X: the platform turns by 1.1"));
        EXPECT_LE(f.warnings.size(), 2U) << "the azimuth zero of accelerometers 10' off, perhaps";
        // Gyro axes turned by 2 deg about z: the zero is theirs.
        const auto turned_by = [&p](double deg) -> Matrix3d {
            return p * Eigen::AngleAxisd(deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ())
                           .toRotationMatrix();
        };
        f = find_by_torque(rig.found, rig.rate, rig.torqued(turned_by(2)));
        ASSERT_EQ(f.verdict, Verdict::decided) << f.why;
        const double square = find_by_torque(rig.found, rig.rate, rig.torqued(p)).turn_arcmin;
        EXPECT_NEAR(f.turn_arcmin - square, 120, 8);
        EXPECT_THAT(f.warnings,
                    ::testing::Contains(HasSubstr("the azimuth zero is the torquers'")));
        f = find_by_torque(rig.found, rig.rate, rig.torqued(turned_by(8)));
        EXPECT_EQ(f.verdict, Verdict::refused);
        EXPECT_THAT(f.why, HasSubstr("turned by"));
        Matrix3d skew = Matrix3d::Identity();
        skew(2, 0) = 0.05;  // 3 deg
        f = find_by_torque(rig.found, rig.rate, rig.torqued(p * skew));
        EXPECT_EQ(f.verdict, Verdict::refused);
        EXPECT_THAT(f.why, HasSubstr("command X turns the platform"));
    }
}

TEST(Torquers, WhatIsMissingOrNotFiniteIsRefused) {
    Rig rig(1);
    auto drifts = rig.torqued(Matrix3d::Identity());
    const auto refused = [&rig](const std::vector<Torqued>& given) {
        EXPECT_THROW(static_cast<void>(find_by_torque(rig.found, rig.rate, given)),
                     std::invalid_argument);
    };
    refused({});
    auto less = drifts;
    less.pop_back();
    refused(less);
    less = drifts;
    less.erase(less.begin());
    refused(less);
    less = drifts;
    less[1].command_deg_h = {60, 60, 0};
    refused(less);
    less = drifts;
    less[2].drift.slope[1] = std::numeric_limits<double>::quiet_NaN();
    refused(less);
}

}  // namespace
}  // namespace vibrig::estimator::commissioning
