#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "estimator/filter/mapped.hpp"
#include "estimator/spectrum/table.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/estimator/spectrum/from_samples.hpp"
#include "tests/unit/estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using namespace testing;

/// Dwell by dwell through the filter, as many rows for each run as there are positions. Of random
/// vibration the filter is given `stated` times its mean square.
std::map<std::size_t, std::vector<DwellRow>> rows_of(const plant::Truth& truth,
                                                     const plant::CampaignPlan& plan,
                                                     Settings& settings, double stated = 1) {
    std::optional<Identification> dwell;
    std::pair<std::size_t, std::size_t> now{0, 0};
    std::map<std::size_t, std::vector<DwellRow>> rows;
    const auto close = [&] {
        if (!dwell) return;
        const DwellSummary summary = dwell->end_dwell();
        if (dwell->rows().empty()) {
            EXPECT_NE(stated, 1) << summary.reason;
            return;
        }
        rows[now.first].push_back(dwell->rows()[0]);
    };
    plant::simulate(truth, plan, [&](const plant::PlannedSample& sample) {
        if (now != std::pair{sample.run, sample.position}) {
            close();
            now = {sample.run, sample.position};
            settings.frequency_hz = plan.hz_of(sample.run);
            dwell.emplace(settings, 1);
            DwellInfo info{static_cast<int>(sample.run), static_cast<int>(sample.position)};
            info.random = played_in(truth, plan, sample.run, stated);
            dwell->begin_dwell(info);
        }
        static_cast<void>(dwell->add(measurement_of(sample)));
    });
    close();
    return rows;
}

/// Bolted to the table, half of every quadratic coefficient elastic at 60 Hz, without noise.
plant::Truth half_elastic() {
    plant::Truth truth;
    truth.hard = true;
    truth.elastic_share = {0.5, 0.5, 0.5};
    truth.resolver_arcsec = truth.accelerometer_g = truth.gyro_random_walk_deg_per_rt_h = 0;
    truth.resolver_bits = 24;
    return truth;
}

/// The simulated rig integrates the yielding mass in time; the model knows only its mean.
TEST(SpectrumPlant, AgreesWithTheModelOverTheFrequencies) {
    const plant::Truth truth = half_elastic();
    plant::CampaignPlan plan;
    plan.positions_deg = {{45, 0, 60}, {-60, 10, 20}};
    plan.frequency_hz = {15, 35, 45, 55, 65, 85, 101.3};
    plan.table_g.assign(plan.frequency_hz.size(), 6);
    plan.dwell_s = 60;
    Settings settings;
    const auto rows = rows_of(truth, plan, settings);
    const Truth of_model = Truth::common(0.5, kSixty);
    ASSERT_EQ(rows.size(), plan.frequency_hz.size());
    for (const auto& [run, of_run] : rows) {
        const double hz = plan.hz_of(run);
        for (const DwellRow& row : of_run) {
            Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
            moment(1, 1) = 18;
            const Eigen::Vector3d is =
                drift_of(settings, of_model, {mapped(row.angles), moment, {{hz, 1, 0}}, 0});
            for (Eigen::Index j = 0; j < 3; ++j)
                EXPECT_NEAR(mapped(row.rate)[j], is[j], 2e-4) << hz << " Hz, gyro " << j;
            EXPECT_NEAR(row.vibration.kappa, 19, 19 * 1e-4) << hz;
        }
    }
}

/// A second harmonic of 5 % lies on the resonance: its 0.25 % of the mean square count ten times.
TEST(SpectrumPlant, HarmonicsThatTheSamplesTellAreInTheDrift) {
    plant::Truth truth = half_elastic();
    truth.second_harmonic = 0.05;
    truth.third_harmonic = 0.03;
    truth.sample_rate_hz = 400;
    plant::CampaignPlan plan;
    plan.positions_deg = {{45, 0, 60}};
    plan.frequency_hz = {28.3};
    plan.table_g = {6};
    plan.dwell_s = 60;
    Settings settings;
    const auto rows = rows_of(truth, plan, settings);
    const DwellRow& row = rows.at(1).at(0);
    constexpr double kWhole = 1 + 0.05 * 0.05 + 0.03 * 0.03;
    EXPECT_NEAR(row.harmonics[0], 0.0025 / kWhole, 2e-5);
    EXPECT_NEAR(row.harmonics[1], 0.0009 / kWhole, 2e-5);
    const std::vector<Band> alone{{28.3, 1, 0}}, with = bands_of(settings, row, alone);
    ASSERT_EQ(with.size(), 3U);
    const auto error = [&](const std::vector<Band>& bands) {
        const Eigen::Vector3d is =
            drift_of(settings, Truth::common(0.5, kSixty),
                     {mapped(row.angles), level_moment(row.vibration), bands, 0});
        return (mapped(row.rate) - is).cwiseAbs().maxCoeff();
    };
    EXPECT_LT(error(with), 4e-4);
    EXPECT_GT(error(alone), 2e-3);
    // AND the table of a campaign takes them.
    const SpectralTable table(settings, {{row, std::size_t{0}, 0, {}}}, {{"", alone}});
    EXPECT_EQ(table.elastic_weights(kSixty)[0], elastic_weight(with, kSixty));
}

/// Random vibration: the drift of the profile, but for what its realisation strays by in the time.
TEST(SpectrumPlant, AgreesWithTheModelUnderRandomVibration) {
    plant::Truth truth = half_elastic();
    truth.limit_mm = 100;
    const auto profiles = six_profiles();
    constexpr std::array<std::size_t, 4> kPlayed{2, 3, 4, 5};  // 20-200 Hz, truck, integrity, 70-90
    plant::CampaignPlan plan;
    plan.positions_deg = {{45, 0, 60}};
    plan.dwell_s = 100;
    plan.table_g.clear();
    for (const std::size_t p : kPlayed) {
        truth.profiles.push_back({static_cast<std::uint16_t>(p), profiles[p].psd});
        plan.profile.push_back(static_cast<std::uint16_t>(p));
        plan.table_g.push_back(std::sqrt(mean_square(profiles[p])));
    }
    Settings settings;
    const auto rows = rows_of(truth, plan, settings);
    const Truth of_model = Truth::common(0.5, kSixty);
    ASSERT_EQ(rows.size(), kPlayed.size());
    for (const auto& [run, of_run] : rows) {
        const Profile& profile = profiles[kPlayed[run - 1]];
        const double all = mean_square(profile);
        const DwellRow& row = of_run.front();
        const auto drift = [&](double moment, const std::vector<Band>& bands) {
            Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
            second(1, 1) = moment;
            return drift_of(settings, of_model, {mapped(row.angles), second, bands, 0});
        };
        const Eigen::Vector3d still = drift(0, {});
        Eigen::Vector3d variance = Eigen::Vector3d::Zero();
        for (const Band& band : bands_of(profile, 100)) {
            const Eigen::Vector3d of_band = drift(all * band.share, {{band.hz, 1, 0}}) - still;
            variance += of_band.cwiseAbs2() / (band.width_hz * plan.dwell_s);
        }
        const Eigen::Vector3d is = drift(all, bands_of(profile));
        for (Eigen::Index j = 0; j < 3; ++j)
            EXPECT_NEAR(mapped(row.rate)[j], is[j],
                        std::min(0.0064, 4 * std::sqrt(variance[j]) + 2e-4))
                << profile.name << ", gyro " << j;
        // What happened, by 4000 slow samples and a profile whose gain is known to 1 %.
        EXPECT_TRUE(row.random && row.apart);
        EXPECT_NEAR((row.vibration.kappa - 1) / all, 1, 4 * row.relative_error) << profile.name;
        const double by_profile =
            std::hypot(0.01, 1 / std::sqrt(bandwidth_hz(bands_of(profile)) * 100));
        EXPECT_NEAR(row.relative_error, 1 / std::hypot(1 / by_profile, std::sqrt(2000.0)), 1e-4);
    }
    // A level that is not the profile's is no dwell: 20 % are six standard errors.
    EXPECT_TRUE(rows_of(truth, plan, settings, 1.2).empty());
}

}  // namespace
}  // namespace vibrig::estimator::spectrum
