#include "estimator/spectrum/swept_rates.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/spectrum/analysis.hpp"
#include "estimator/spectrum/resonance.hpp"
#include "estimator/spectrum/sweep_blocks.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/estimator/spectrum/from_samples.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

constexpr double kPerRadian = 180 / std::numbers::pi;

/// An exponential sweep at an attitude that hardly moves, level constant at the platform.
Sweep sweep_of(double from_hz, double to_hz, double seconds, double peak_g,
               const std::array<double, 3>& deg = {0, 0, 0}) {
    Sweep sweep{1, 1, {}};
    const auto hz_at = [&](double t) { return from_hz * std::pow(to_hz / from_hz, t / seconds); };
    for (int k = 0; k < static_cast<int>(seconds); ++k) {
        SweepBlock block;
        block.time_s = k + 0.5;
        block.samples = 40;
        block.from_hz = hz_at(k);
        block.to_hz = hz_at(k + 1);
        for (std::size_t i = 0; i < 3; ++i) block.angle_rad[i] = deg[i] / kPerRadian;
        block.moment.emplace()[1][1] = peak_g * peak_g / 2;
        sweep.blocks.push_back(block);
    }
    return sweep;
}

/// Standard deviations of the elastic coefficient of the square along the vertical, of frequency
/// and damping, all else known.
Eigen::Vector3d deviations(const SweptRates& swept, double elastic, const Resonance& at) {
    Eigen::Index column = 0;
    swept.elastic({1e4, 0.5}).colwise().norm().maxCoeff(&column);
    swept.elastic(at).colwise().norm().maxCoeff(&column);
    const auto seen = [&](const Resonance& r) {
        return Eigen::VectorXd(elastic * swept.elastic(r).col(column));
    };
    Eigen::MatrixXd j(swept.size(), 3);
    j.col(0) = seen(at) / elastic;
    j.col(1) = (seen({at.hz + 1e-3, at.damping}) - seen({at.hz - 1e-3, at.damping})) / 2e-3;
    j.col(2) = (seen({at.hz, at.damping + 1e-5}) - seen({at.hz, at.damping - 1e-5})) / 2e-5;
    const Eigen::Matrix3d information = j.transpose() * j;
    return Eigen::Matrix3d(information.inverse()).diagonal().cwiseSqrt();
}

/// The theory's table of section 5.4 for E = 0.015, a resonance at 60 Hz and damping 0.05.
TEST(Sweep, TellsElasticPartFrequencyAndDampingAsTheTheorySays) {
    struct Row {
        double from_hz, to_hz, seconds, peak_g;
        std::array<double, 3> sigma;  // E, f_r, damping
        double last_digit;            // of the damping's
    };
    for (const Row& row : {Row{20, 120, 100, 6, {.0004, 0.20, .005}, 1e-3},
                           Row{20, 120, 100, 3, {.0017, 0.81, .018}, 1e-3},
                           Row{20, 120, 300, 6, {.0002, 0.05, .0013}, 1e-4},
                           Row{20, 120, 300, 3, {.0007, 0.21, .005}, 1e-3},
                           Row{50, 70, 100, 6, {.0003, 0.03, .0013}, 1e-4},
                           Row{50, 70, 100, 3, {.0012, 0.13, .005}, 1e-3}}) {
        const SweptRates swept(Settings{},
                               sweep_of(row.from_hz, row.to_hz, row.seconds, row.peak_g), 1, 0);
        const auto found = deviations(swept, 0.015, testing::kSixty);
        std::printf("# %g-%g Hz %g s %g g: E %.5f f_r %.3f damping %.4f\n", row.from_hz, row.to_hz,
                    row.seconds, row.peak_g, found[0], found[1], found[2]);
        // Half of the last digit that the table has, and 3 %.
        const std::array<double, 3> digit{1e-4, 1e-2, row.last_digit};
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_NEAR(found[static_cast<Eigen::Index>(i)], row.sigma[i],
                        digit[i] / 2 + 0.03 * row.sigma[i]);
        const SweptRates free(Settings{}, sweep_of(row.from_hz, row.to_hz, row.seconds, row.peak_g),
                              1);
        const auto shape = deviations(free, 0.015, testing::kSixty);
        std::printf("#   shape alone: E %.5f f_r %.3f damping %.4f\n", shape[0], shape[1],
                    shape[2]);
        for (int i = 0; i < 3; ++i) EXPECT_GE(shape[i], found[i]);
        EXPECT_LT(shape[1], 1.5 * found[1]) << "a bias that walks costs no more";
    }
}

/// Block means of a gyro's random walk, read with the encoders' noise.
void add_noise(const Settings& settings, Sweep& sweep, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    constexpr int kSteps = 40;
    const double step = 60 * settings.gyro_random_walk_deg_per_rt_h / std::sqrt(kSteps);
    std::array<double, 3> angle{};  // arcsec
    for (SweepBlock& block : sweep.blocks) {
        for (std::size_t i = 0; i < 3; ++i) {
            double sum = 0;
            for (int n = 0; n < kSteps; ++n) {
                angle[i] += step * normal(random);
                sum += angle[i] + settings.resolver_arcsec * normal(random);
            }
            block.angle_rad[i] += sum / kSteps / kArcsecPerRad;
        }
    }
}

TEST(Sweep, ItsRatesAreWhite) {
    constexpr unsigned kSeeds = 40;
    const Settings settings;
    double square = 0, neighbours = 0, number = 0;
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
        std::mt19937_64 random(seed);
        Sweep sweep = sweep_of(20, 120, 300, 6), still = sweep;
        add_noise(settings, sweep, random);
        for (std::size_t gyro = 0; gyro < 3; ++gyro) {
            const SweptRates noisy(settings, sweep, gyro, 0), ideal(settings, still, gyro, 0);
            const Eigen::VectorXd left = noisy.rate() - ideal.rate();
            square += left.squaredNorm();
            neighbours += left.head(left.size() - 1).dot(left.tail(left.size() - 1));
            number += static_cast<double>(left.size());
        }
    }
    // Three sigma of chi square, and of a correlation that is none.
    EXPECT_NEAR(square / number, 1, 3 * std::sqrt(2 / number)) << "seeds 1 to " << kSeeds;
    EXPECT_NEAR(neighbours / number, 0, 3 / std::sqrt(number));
}

TEST(Sweep, WhatIsNotKnownIsLeftOutAndNothingElse) {
    const Settings settings;
    Sweep sweep = sweep_of(20, 120, 100, 6);
    EXPECT_EQ(SweptRates(settings, sweep, 1).size(), 99);
    for (const std::size_t k : {0U, 50U, 51U, 60U, 62U, 99U}) sweep.blocks[k].moment.reset();
    EXPECT_EQ(sweep.known(), 94U);
    const SweptRates swept(settings, sweep, 1);
    // Of 94 in the stretches 1-49, 52-59, 61, 63-98: one rate fewer than blocks in each.
    EXPECT_EQ(swept.size(), 94 - 4);
    EXPECT_TRUE(swept.rate().allFinite() && swept.base().allFinite() &&
                swept.elastic(testing::kSixty).allFinite());
    for (SweepBlock& block : sweep.blocks) block.moment.reset();
    EXPECT_EQ(SweptRates(settings, sweep, 1).size(), 0);
    EXPECT_EQ(SweptRates(settings, {}, 0).size(), 0);
    Sweep back = sweep_of(20, 120, 10, 6);
    std::swap(back.blocks[3].time_s, back.blocks[4].time_s);
    EXPECT_THROW(SweptRates(settings, back, 0), std::invalid_argument);
}

/// Of the simulated rig, which integrates the yielding masses in time.
std::vector<Sweep> swept_by_plant(const plant::Truth& truth, const plant::CampaignPlan& plan,
                                  const Settings& settings) {
    std::vector<Sweep> out;
    std::optional<SweepBlocks> blocks;
    std::pair<std::size_t, std::size_t> now{0, 0};
    const auto close = [&] {
        if (!blocks) return;
        out.push_back(blocks->finish());
        EXPECT_GT(blocks->shown(), 0.99);
    };
    plant::simulate(truth, plan, [&](const plant::PlannedSample& sample) {
        if (now != std::pair{sample.run, sample.position}) {
            close();
            now = {sample.run, sample.position};
            blocks.emplace(settings, static_cast<int>(sample.run),
                           static_cast<int>(sample.position));
        }
        blocks->add(testing::measurement_of(sample), sample.hz);
    });
    close();
    return out;
}

plant::Truth elastic_rig() {
    plant::Truth truth;
    truth.hard = true;
    truth.elastic_share = {0.5, 0.5, 0.5};
    truth.sample_rate_hz = 400;
    return truth;
}

plant::CampaignPlan swept(double dwell_s, std::vector<plant::Vec3> positions_deg) {
    plant::CampaignPlan plan;
    plan.positions_deg = std::move(positions_deg);
    plan.sweep = {{20, 120}, {120, 20}};
    plan.table_g = {6, 6};
    plan.dwell_s = dwell_s;
    return plan;
}

TEST(SweepOfThePlant, AgreesWithTheModel) {
    plant::Truth truth = elastic_rig();
    truth.resolver_arcsec = truth.accelerometer_g = truth.gyro_random_walk_deg_per_rt_h = 0;
    truth.resolver_bits = 24;
    const Settings settings;
    const auto sweeps = swept_by_plant(truth, swept(104, {{45, 0, 60}, {-60, 10, 20}}), settings);
    ASSERT_EQ(sweeps.size(), 4U);
    const testing::Truth of_model = testing::Truth::common(0.5, testing::kSixty);
    for (const Sweep& sweep : sweeps) {
        EXPECT_GE(sweep.known(), 80U) << "of 104";
        for (std::size_t j = 0; j < 3; ++j) {
            // Nothing in common is taken out: the mean is held as well.
            const SweptRates swept(settings, sweep, j, 0);
            Eigen::VectorXd linear(10), elastic(6);
            for (std::size_t g = 0; g < 10; ++g)
                linear[static_cast<Eigen::Index>(g)] = testing::table2()[internal_index(g, j)];
            for (std::size_t q = 0; q < 6; ++q)
                elastic[static_cast<Eigen::Index>(q)] = of_model.elastic[j][0].coefficients[q];
            const Eigen::VectorXd left =
                swept.rate() - swept.base() * linear - swept.elastic(testing::kSixty) * elastic;
            const Eigen::VectorXd rigid = swept.rate() - swept.base() * linear;
            std::printf(
                "# run %d position %d gyro %zu: rms %.3f of its noise, without the elastic part "
                "%.1f\n",
                sweep.run, sweep.position, j,
                std::sqrt(left.squaredNorm() / static_cast<double>(left.size())),
                std::sqrt(rigid.squaredNorm() / static_cast<double>(left.size())));
            EXPECT_LT(left.squaredNorm() / static_cast<double>(left.size()), 0.2 * 0.2);
        }
    }
}

/// Rates of the dwells at 15 Hz and at rest, which tell nothing of a resonance, and sweeps.
struct Campaign {
    Campaign(double share, unsigned seed) : random(seed) {
        auto dwells = testing::dwells_of(settings, testing::Truth::common(share, testing::kSixty),
                                         testing::today());
        testing::add_noise(dwells, random);
        table.emplace(settings, dwells.list, dwells.kinds);
    }
    [[nodiscard]] Mixture mixture(std::size_t j, const std::vector<Sweep>& sweeps) const {
        const Eigen::Index n = table->dwells();
        GyroProblem problem{
            Eigen::VectorXd(n), Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Ones(10), {}};
        problem.prior_sigma.head(4).setConstant(10);
        for (Eigen::Index k = 0; k < n; ++k) {
            const DwellRow& row = table->rows()[static_cast<std::size_t>(k)];
            problem.rate[k] = row.rate[j];
            problem.covariance(k, k) = row.variance[j][j];
        }
        for (const Sweep& sweep : sweeps) problem.swept.emplace_back(settings, sweep, j);
        return one_resonance(*table, j, problem);
    }
    Settings settings;
    std::mt19937_64 random;
    std::optional<SpectralTable> table;
};

TEST(Sweep, OneFrequencyNeitherShowsNorExcludesAResonance) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const Campaign campaign(seed % 2 == 0 ? 0.5 : 0, seed);
        for (std::size_t j = 0; j < 3; ++j)
            EXPECT_LT(std::abs(campaign.mixture(j, {}).log_odds), 2) << "seed " << seed;
    }
}

/// One sweep of the simulated rig over 100 s, up or down, beside what 15 Hz and rest tell: its
/// frequency within the theory's table (0.27 and 0.21 Hz from samples), and as well as it says.
TEST(SweepOfThePlant, TellsTheFrequencyAsWellAsItSays) {
    constexpr unsigned kSeeds = 20;
    for (const bool up : {true, false}) {
        double sum = 0, square = 0, z = 0;
        for (unsigned seed = 1; seed <= kSeeds; ++seed) {
            plant::Truth truth = elastic_rig();
            truth.seed = seed;
            plant::CampaignPlan plan = swept(104, {{0, 0, 0}});
            plan.table_g = {6};
            plan.sweep = {plan.sweep[up ? 0 : 1]};
            const Campaign campaign(0.5, seed);
            const auto sweeps = swept_by_plant(truth, plan, campaign.settings);
            // Gyro y has its input axis along the vibration.
            const Mixture mixture = campaign.mixture(1, sweeps);
            EXPECT_TRUE(mixture.named()) << "seed " << seed;
            ASSERT_TRUE(mixture.resonant()) << "seed " << seed;
            const ResonanceEstimate fitted = estimates(mixture).front();
            sum += fitted.hz.mean - 60;
            square += (fitted.hz.mean - 60) * (fitted.hz.mean - 60);
            z += std::pow((fitted.hz.mean - 60) / fitted.hz.sigma, 2);
        }
        const double rms = std::sqrt(square / kSeeds), mean = sum / kSeeds;
        std::printf("# %s: %.3f Hz off, rms %.3f, %.2f of its sigma\n", up ? "up" : "down", mean,
                    rms, std::sqrt(z / kSeeds));
        EXPECT_LT(rms, 0.27 * std::sqrt(1 + 3 * std::sqrt(2.0 / kSeeds)));
        EXPECT_NEAR(z / kSeeds, 1, 3 * std::sqrt(2.0 / kSeeds));
    }
}

/// The angles of a sweep as they drift by the model, at an attitude that hardly moves.
void let_drift(const Settings& settings, const testing::Truth& truth, Sweep& sweep) {
    const Kinematics kinematics(settings);
    const double sign = settings.drift_sign < 0 ? -1 : 1;
    Eigen::Vector3d angles = kinematics.gimbal_angles(sweep.blocks[0].angle_rad);
    const Pose pose = kinematics.pose(angles);
    std::vector<Eigen::Vector3d> rates;
    for (const SweepBlock& block : sweep.blocks) {
        const Attitude at = attitude(settings, angles, mapped(*block.moment));
        Eigen::Vector3d rate;
        for (std::size_t j = 0; j < 3; ++j) {
            double one = 0;
            for (std::size_t g = 0; g < 10; ++g)
                one += at.base[j][static_cast<Eigen::Index>(g)] *
                       testing::table2()[internal_index(g, j)];
            for (const auto& part : truth.elastic[j]) {
                const double hz = std::sqrt(block.from_hz * block.to_hz);
                for (std::size_t q = 0; q < 6; ++q)
                    one += (in_phase(hz, part.resonance) - 1) * part.coefficients[q] *
                           at.vibration[j][static_cast<Eigen::Index>(q)];
            }
            rate[static_cast<Eigen::Index>(j)] = one;
        }
        rates.push_back(rate);
    }
    std::array<double, 3> moved{};
    for (std::size_t k = 1; k < sweep.blocks.size(); ++k) {
        const Eigen::Vector3d mean = (rates[k - 1] + rates[k]) / 2;
        const Eigen::Vector3d turn = pose.m * (sign * mean - pose.earth_rate) / kArcsecPerRad;
        for (std::size_t i = 0; i < 3; ++i) {
            moved[i] += turn[static_cast<Eigen::Index>(i)];
            sweep.blocks[k].angle_rad[i] += moved[i];
        }
    }
}

/// A survey with two resonances within it, and two sweeps beside it: both frequencies are known
/// better, and as well as is said.
TEST(Sweep, TakesPartWhereTwoResonancesAre) {
    testing::Truth truth = testing::Truth::common(0.25, {40, 0.05});
    const testing::Truth other = testing::Truth::common(0.25, {95, 0.05});
    for (std::size_t j = 0; j < 3; ++j)
        truth.elastic[j].insert(truth.elastic[j].end(), other.elastic[j].begin(),
                                other.elastic[j].end());
    const Settings settings = testing::undeclared();
    double square = 0, number = 0;
    for (unsigned seed = 1; seed <= 3; ++seed) {
        std::mt19937_64 random(seed);
        auto plan = testing::survey();
        testing::shuffle(plan, random);
        auto dwells = testing::dwells_of(settings, truth, plan);
        testing::add_noise(dwells, random);
        const SpectralTable table(settings, dwells.list, dwells.kinds);
        std::vector<Sweep> sweeps{sweep_of(20, 120, 300, 6), sweep_of(120, 20, 300, 6)};
        for (Sweep& sweep : sweeps) {
            let_drift(settings, truth, sweep);
            add_noise(settings, sweep, random);
        }
        const Analysis without = analyse(settings, table, Form::automatic),
                       with = analyse(settings, table, Form::automatic, sweeps);
        // Gyro y has its input axis along the vibration of the sweeps.
        constexpr std::size_t kY = 1;
        ASSERT_TRUE(without.second[kY] && with.second[kY]) << "seed " << seed;
        EXPECT_GT(with.lack_of_fit[kY], 1e-3) << "seed " << seed;
        const auto before = estimates(without.gyros[kY]), after = estimates(with.gyros[kY]);
        ASSERT_EQ(after.size(), 2U);
        for (std::size_t r = 0; r < 2; ++r) {
            const bool low = after[r].hz.mean < 65;
            EXPECT_LT(after[r].hz.sigma, 0.9 * before[r].hz.sigma) << "seed " << seed;
            const double z = (after[r].hz.mean - (low ? 40 : 95)) / after[r].hz.sigma;
            std::printf("# seed %u: %.3f +- %.3f Hz, without the sweeps %.3f +- %.3f\n", seed,
                        after[r].hz.mean, after[r].hz.sigma, before[r].hz.mean, before[r].hz.sigma);
            square += z * z;
            number += 1;
        }
    }
    EXPECT_LT(square / number, 1 + 3 * std::sqrt(2 / number));
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
