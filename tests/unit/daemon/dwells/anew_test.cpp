#include "daemon/dwells/anew.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <bit>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "daemon/dwells/player.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::dwells {
namespace {

using estimator::kParameters;

struct FedDwell {
    estimator::DwellInfo info;
    std::vector<estimator::Measurement> measurements;
};

/// One campaign through the daemon's stage and monitor, and what was fed.
struct Campaign {
    estimator::Result live;
    std::optional<noise::Found> found;
    std::vector<FedDwell> dwells;
    std::array<double, kParameters> truth{};
};

plant::CampaignPlan balanced() {
    plant::CampaignPlan plan;
    plan.dwell_s = 50;
    plan.order = plant::parse_order(
        "1.9,2.11,1.5,2.3,2.7,1.14,2.12,1.13,2.6,1.2,1.3,2.4,1.1,2.2,1.10,2.9,1.12,2.1,2.14,1.7,"
        "1.8,2.5,1.6,2.8,1.4,2.13,1.11,2.10");
    for (auto& [run, position] : plan.order) std::swap(run, position);
    return plan;
}

Campaign simulated(const estimator::Settings& settings, double walk, std::uint64_t seed) {
    plant::Truth truth;
    truth.gyro_random_walk_deg_per_rt_h = walk;
    truth.seed = seed;
    const plant::CampaignPlan plan = balanced();
    Campaign out;
    Player player(settings);
    std::vector<drivers::Sample> samples;
    std::uint64_t count = 0;
    drivers::Time from = 0;
    plant::simulate(
        truth, plan,
        [&](const plant::PlannedSample& p) {
            drivers::Sample sample;
            sample.time = drivers::from_seconds(p.time_s);
            for (std::size_t k = 0; k < 3; ++k) {
                sample.angle[k] = p.readings.encoder_deg[k] * (std::numbers::pi / 180);
                sample.force[k] = p.readings.raw_g[k];
                for (std::size_t t = 0; t < plant::kTerms; ++t)
                    out.truth[plant::kTerms * k + t] += p.coefficients[k][t];
            }
            ++count;
            if (samples.empty()) {
                from = sample.time;
                out.dwells.push_back({{static_cast<int>(p.run), static_cast<int>(p.position),
                                       plan.table_g[p.run - 1], p.time_s},
                                      {}});
            }
            samples.push_back(sample);
            out.dwells.back().measurements.push_back(rt::measurement_of(sample, from, {}));
        },
        [&](std::size_t, std::size_t) {
            rt::DwellOrder order;
            order.from = from;
            order.to = from + drivers::from_seconds(plan.dwell_s);
            order.dwell = out.dwells.back().info;
            player.order(order);
            for (std::size_t at = 0; at < samples.size(); at += Player::kMost)
                player.push(
                    std::span(samples).subspan(at, std::min(Player::kMost, samples.size() - at)));
            samples.clear();
            rt::DwellOrder cancel;
            cancel.cancel = true;
            player.order(cancel);
            rt::DwellDone done;
            while (player.take_done(done)) {
            }
        });
    for (double& value : out.truth) value /= static_cast<double>(count);
    out.live = player.book().identification().result();
    out.found = player.book().noise().found();
    return out;
}

estimator::Result anew(const estimator::Settings& settings, const Campaign& campaign) {
    Anew again(settings, *campaign.found, campaign.dwells.size());
    for (const FedDwell& dwell : campaign.dwells) {
        again.identification().begin_dwell(dwell.info);
        for (const auto& m : dwell.measurements) static_cast<void>(again.identification().add(m));
        static_cast<void>(again.identification().end_dwell());
    }
    return again.result();
}

/// e' P^-1 e of all 30.
double nees(const estimator::Result& result, const std::array<double, kParameters>& truth) {
    Eigen::VectorXd e(kParameters);
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        e[k] = (result.value[i] - truth[i]) / result.sigma[i];
    }
    Eigen::MatrixXd c = estimator::mapped(result.covariance);
    const Eigen::VectorXd scale = c.diagonal().cwiseSqrt().cwiseInverse();
    c = scale.asDiagonal() * c * scale.asDiagonal();
    return e.dot(c.llt().solve(e));
}

TEST(CampaignAnew, MonteCarloErrorsAreAsStatedWithAWrongGyroNoiseConfigured) {
    // GIVEN gyros three times as noisy as configured, 20 campaigns of 28 dwells
    constexpr int kRuns = 20;
    constexpr std::uint64_t kSeed = 5200;
    const estimator::Settings settings;
    double live = 0, again = 0;
    for (std::uint64_t seed = kSeed; seed < kSeed + kRuns; ++seed) {
        const Campaign campaign = simulated(settings, 0.003, seed);
        live += nees(campaign.live, campaign.truth) / (kParameters * kRuns);
        ASSERT_TRUE(campaign.found) << "seed " << seed;
        // WHEN identified anew with the noise found
        const estimator::Result result = anew(settings, campaign);
        again += nees(result, campaign.truth) / (kParameters * kRuns);
        // THEN filter and batch agree again, and it is said
        EXPECT_TRUE(result.cross_check.agrees()) << "seed " << seed;
        EXPECT_NE(result.warnings.back().find("identified anew"), std::string::npos);
    }
    std::printf("z-rms live %.3f, anew %.3f (seeds from %d)\n", std::sqrt(live), std::sqrt(again),
                static_cast<int>(kSeed));
    EXPECT_GT(std::sqrt(live), 1.3);
    // chi-square of 600 degrees at 1e-3; N^2 is known with 100 degrees in each of 60, which makes
    // the mean 2 % larger and its standard deviation 2 %
    EXPECT_NEAR(again, 1, 3.29 * std::sqrt(2.0 / (kParameters * kRuns)) + 0.02 + 3.29 * 0.02);
}

TEST(CampaignAnew, IsNotDoneWhereTheNoiseIsTheConfiguredOne) {
    EXPECT_FALSE(simulated({}, 0.001, 5300).found) << "seed 5300";
}

TEST(CampaignAnew, TheNoiseOfAResultReadsBackToTheBit) {
    const noise::Found found{{5.0131245, {1.0 / 3e2, 0.1 / 37, 0.002}}, 1.0 / 3e-2};
    Live live{found, {}, {}};
    const std::string text = tool::result_json({}, {}, false, nullptr, &live);
    ASSERT_TRUE(noise_found_in(text));
    EXPECT_EQ(*noise_found_in(text), found);
    EXPECT_FALSE(noise_found_in(tool::result_json({})));
    EXPECT_FALSE(noise_found_in("no JSON"));
    EXPECT_FALSE(noise_found_in(R"({"identified_anew":{"noise":{"dof":1}}})"));
}

}  // namespace
}  // namespace vibrig::dwells
