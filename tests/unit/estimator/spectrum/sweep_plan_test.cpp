#include "estimator/spectrum/sweep_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "estimator/plan/positions.hpp"
#include "estimator/spectrum/sweep_blocks.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using estimator::testing::kTable1;
using plan::Vec3;

std::vector<Vec3> verticals() {
    std::vector<Vec3> ups;
    for (const auto& deg : kTable1)
        ups.push_back(plan::up_at(Settings{}, {deg[0], deg[1], deg[2]}));
    return ups;
}

/// Written a second time: of three directions the sums of u_i^2 u_j^2, multiplied; 0 where they
/// have one combination twice.
double product_of(const std::vector<Vec3>& ups, const std::array<std::size_t, 3>& at) {
    Eigen::Matrix<double, 3, 6> rows;
    double product = 1;
    for (std::size_t i = 0, column = 0; i < 3; ++i) {
        for (std::size_t j = i; j < 3; ++j, ++column) {
            double sum = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const double both = ups[at[k]][i] * ups[at[k]][j];
                rows(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(column)) = both;
                sum += both * both;
            }
            product *= sum;
        }
    }
    return std::abs((rows * rows.transpose()).determinant()) < 1e-9 ? 0 : product;
}

double best_of_all(const std::vector<Vec3>& ups) {
    double best = 0;
    for (std::size_t a = 0; a < ups.size(); ++a)
        for (std::size_t b = a + 1; b < ups.size(); ++b)
            for (std::size_t c = b + 1; c < ups.size(); ++c)
                best = std::max(best, product_of(ups, {a, b, c}));
    return best;
}

std::array<std::size_t, 3> three(const Places& places) {
    EXPECT_EQ(places.size(), 3U);
    return {places.at(0), places.at(1), places.at(2)};
}

std::string sweeps_complaint(const std::vector<Vec3>& ups) {
    try {
        static_cast<void>(sweep_places(ups));
    } catch (const plan::PlanError& error) {
        return error.what();
    }
    return "";
}

/// A block after the other at this attitude, 6 g along the vertical.
Sweep sweep_at(const Vec3& deg) {
    Sweep sweep{1, 1, {}};
    for (int k = 0; k < 300; ++k) {
        SweepBlock block;
        block.time_s = k + 0.5;
        block.samples = 200;
        block.from_hz = 20 * std::pow(6, k / 300.0);
        block.to_hz = 20 * std::pow(6, (k + 1) / 300.0);
        for (std::size_t i = 0; i < 3; ++i) block.angle_rad[i] = deg[i] * (std::numbers::pi / 180);
        block.moment.emplace()[1][1] = 18;
        sweep.blocks.push_back(block);
    }
    return sweep;
}

TEST(SweepPlan, OfTable1TheThreeBestByAllOfThem) {
    const auto ups = verticals();
    const Places places = sweep_places(ups);
    EXPECT_TRUE(std::ranges::is_sorted(places));
    const double found = product_of(ups, three(places)), best = best_of_all(ups);
    std::printf("# positions %zu %zu %zu: %.5g of %.5g\n", places[0] + 1, places[1] + 1,
                places[2] + 1, found, best);
    EXPECT_NEAR(found, best, 1e-9 * best);
    double product = 1;
    for (const double seen : products_seen(ups, places)) product *= seen;
    EXPECT_NEAR(product, found, 1e-12);
}

/// By the rows that a result is made of: a resonance of 60 Hz in any one of the coefficients.
TEST(SweepPlan, EveryGyroSeesEachOfItsSixCoefficients) {
    const Places places = sweep_places(verticals());
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        Eigen::VectorXd power = Eigen::VectorXd::Zero(6);
        for (const std::size_t place : places) {
            const auto& deg = kTable1.at(place);
            const SweptRates swept(Settings{}, sweep_at({deg[0], deg[1], deg[2]}), gyro);
            power += swept.elastic({60, 0.05}).colwise().squaredNorm().transpose();
        }
        std::printf(
            "# gyro %zu: %s\n", gyro,
            ::testing::PrintToString(std::vector<double>(power.begin(), power.end())).c_str());
        // u_i^2 u_j^2 of a product is at most a quarter of a square's; 0.01 deg/h/g^2 then stand
        // out of the noise by 30 to 1 at least.
        for (const double of : power) EXPECT_GT(0.01 * std::sqrt(of), 30) << "gyro " << gyro;
    }
}

TEST(SweepPlan, AndOfAnyOtherDirections) {
    const auto cube = plan::cube_directions();
    EXPECT_NEAR(product_of(cube, three(sweep_places(cube))), best_of_all(cube), 1e-12);
    for (unsigned seed = 1; seed <= 20; ++seed) {
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal;
        std::vector<Vec3> ups(24);
        for (Vec3& up : ups) {
            for (double& x : up) x = normal(random);
            const double norm = std::hypot(up[0], up[1], up[2]);
            for (double& x : up) x /= norm;
        }
        const double found = product_of(ups, three(sweep_places(ups)));
        EXPECT_NEAR(found, best_of_all(ups), 1e-9) << "seed " << seed;
    }
}

TEST(SweepPlan, WhereNoThreeSeeAllSixItSaysWhich) {
    const std::vector<Vec3> axes{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}};
    EXPECT_NE(
        sweeps_complaint(axes).find("found no positions in which xy (platform axes) is shaken"),
        std::string::npos)
        << sweeps_complaint(axes);
    std::vector<Vec3> plane;
    for (const double angle : {0.1, 0.7, 1.3, 2.0, 2.9})
        plane.push_back({std::cos(angle), std::sin(angle), 0});
    EXPECT_NE(sweeps_complaint(plane).find("zz (platform axes)"), std::string::npos)
        << sweeps_complaint(plane);
    const Vec3 up{0.6, 0.64, 0.48}, down{-0.6, -0.64, -0.48};
    EXPECT_NE(sweeps_complaint({up, down, up}).find("found positions of rank 1"), std::string::npos)
        << sweeps_complaint({up, down, up});
    EXPECT_NE(sweeps_complaint({}).find("found 0 positions"), std::string::npos);
}

TEST(SweepPlan, SaysWhichSecondsCanBeUsed) {
    // The theory: of 20 to 120 Hz 40 samples a second leave one in seven or so, 400 all but four in
    // a hundred.
    EXPECT_NEAR(usable_blocks({20, 120, 300}, 40).share(), 1.0 / 7, 0.05);
    EXPECT_NEAR(usable_blocks({20, 120, 300}, 400).share(), 0.96, 0.005);
    // At 100/s within 4/n Hz about 100 k/n: 20 (half), 25, 33.3, 40, 50, 60, 66.7, 75, 80, 100, 120
    // (half). A block is out where any part of it is.
    double out = 0;
    const auto about = [&](double hz, double half) {
        out += std::log(std::min(hz + half, 120.0) / std::max(hz - half, 20.0));
    };
    for (const auto& [hz, half] : {std::pair{20.0, 0.8},
                                   {25.0, 1.0},
                                   {100 / 3.0, 4 / 3.0},
                                   {40.0, 0.8},
                                   {50.0, 2.0},
                                   {60.0, 0.8},
                                   {200 / 3.0, 4 / 3.0},
                                   {75.0, 1.0},
                                   {80.0, 0.8},
                                   {100.0, 4.0},
                                   {120.0, 0.8}})
        about(hz, half);
    const auto all = usable_blocks({20, 120, 300}, 100);
    EXPECT_EQ(all.blocks, 300U);
    EXPECT_NEAR(static_cast<double>(all.known) / 300, 1 - out / std::log(6.0), 11.0 / 300);
    // Between neighbours: one fewer than blocks in each of the ten stretches.
    EXPECT_EQ(all.rates, all.known - 10);
    const auto down = usable_blocks({120, 20, 300}, 100);
    EXPECT_NEAR(static_cast<double>(down.known), static_cast<double>(all.known), 2);
    EXPECT_EQ(usable_blocks({97, 103, 60}, 100).known, 0U);
}

/// The blocks that are made of samples say the same.
TEST(SweepPlan, AsTheBlocksOfItsSamplesDo) {
    for (const double rate_hz : {100.0, 200.0, 400.0}) {
        const SweptSine of{20, 95, 100};
        SweepBlocks blocks(Settings{}, 1, 1);
        double phase = 0;
        for (int k = 0; k <= static_cast<int>(of.seconds * rate_hz); ++k) {
            const double t = k / rate_hz;
            const double hz = of.from_hz * std::pow(of.to_hz / of.from_hz, t / of.seconds);
            phase += 2 * std::numbers::pi * hz / rate_hz;
            Measurement m;
            m.time_s = t;
            m.force_g = {0, 1 + 6 * std::sin(phase), 0};
            m.angles_good = m.force_good = true;
            blocks.add(m, hz);
        }
        const auto predicted = usable_blocks(of, rate_hz);
        const Sweep sweep = blocks.finish();
        EXPECT_EQ(sweep.blocks.size(), predicted.blocks);
        EXPECT_NEAR(static_cast<double>(sweep.known()), static_cast<double>(predicted.known), 2)
            << rate_hz;
    }
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
