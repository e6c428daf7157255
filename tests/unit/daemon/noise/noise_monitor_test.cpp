#include "daemon/noise/noise_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"

namespace vibrig::noise {
namespace {

using estimator::DwellSummary;
using estimator::Settings;

struct Rig {
    double angle_arcsec = 5.013;  // the default's, quantisation included
    double walk = 1e-3;           // deg/sqrt(h)
    std::size_t blocks = 98;
    std::array<double, 3> step_deg_h{};  // of the gyros' constant drift
};

/// Feeds the monitor with the block means of a drifting platform, dwell after dwell.
class NoiseMonitorTest : public ::testing::Test {
  protected:
    NoiseMonitorTest()
        : monitor_(settings_, [this](Severity severity, const std::string& text) {
              events_.emplace_back(severity, text);
          }) {
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            coefficients_[i] = i % 10 < 4 ? 1.0 : 0.03;
        }
    }

    bool dwell(const Rig& rig, std::mt19937_64& generator, int run = 1) {
        DwellSummary summary;
        summary.run = run;
        summary.position = ++position_;
        summary.kappa = 19;
        feed(rig, generator, summary);
        return monitor_.end_dwell(summary, {coefficients_, covariance_});
    }

    void feed(const Rig& rig, std::mt19937_64& generator, const DwellSummary& summary) {
        const estimator::Kinematics kinematics(settings_);
        const estimator::DriftModel model(settings_);
        estimator::ParameterArray parameters{};
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            parameters[estimator::internal_of(i)] = coefficients_[i];
        }
        for (std::size_t j = 0; j < 3; ++j)
            parameters[estimator::internal_of(10 * j)] += rig.step_deg_h[j];
        std::normal_distribution<double> normal;
        // Through zero of the azimuth.
        Eigen::Vector3d angles(0.7, 0.3 * (position_ % 3 - 1), -1e-4);
        constexpr int kRate = 40;
        for (std::uint32_t n = 0; n < rig.blocks; ++n) {
            rt::BlockRecord block;
            block.dwell = {summary.run, summary.position, 9};
            block.number = n + 2;
            block.samples = kRate;
            block.time_s = n + 2.5;
            Eigen::Vector3d sum = Eigen::Vector3d::Zero();
            const auto noise = [&](double sigma) {
                return Eigen::Vector3d(sigma * normal(generator), sigma * normal(generator),
                                       sigma * normal(generator));
            };
            for (int i = 0; i < kRate; ++i) {
                const estimator::Pose pose = kinematics.pose(angles);
                const auto h = model.regressors(pose.up, summary.kappa);
                const Eigen::Vector3d rate = model.platform_rate(pose, h, parameters.data());
                angles += pose.m *
                          (rate / kRate + noise(60 * rig.walk / std::sqrt(double{kRate}))) /
                          estimator::kArcsecPerRad;
                sum += angles + noise(rig.angle_arcsec) / estimator::kArcsecPerRad;
            }
            for (std::size_t k = 0; k < 3; ++k) {
                const double mean = sum[static_cast<Eigen::Index>(k)] / kRate;
                block.angle_rad[k] = mean < 0 ? mean + 2 * estimator::kPi : mean;
            }
            monitor_.add(block);
        }
    }

    [[nodiscard]] const estimator::allan::FittedTerm& n_of(std::size_t gyro) const {
        return monitor_.status().gyros[gyro].terms[1];
    }
    [[nodiscard]] int events_of(Severity severity) const {
        int count = 0;
        for (const auto& [found, text] : events_) count += found == severity ? 1 : 0;
        return count;
    }

    Settings settings_;
    std::array<double, estimator::kParameters> coefficients_{};
    std::vector<double> covariance_ =
        std::vector<double>(estimator::kParameters * estimator::kParameters, 0.0);  // well known
    std::vector<std::pair<Severity, std::string>> events_;
    NoiseMonitor monitor_;
    int position_ = 0;
};

TEST_F(NoiseMonitorTest, FindsNOfEachGyroAndLeavesARightFilterAlone) {
    // GIVEN a campaign whose noise is that of the settings
    std::mt19937_64 generator(7001);
    for (int d = 0; d < 28; ++d) {
        static_cast<void>(dwell({}, generator));
        // THEN nothing is handed to the filter
        EXPECT_FALSE(monitor_.take_new_levels()) << "seed 7001";
    }
    for (std::size_t j = 0; j < 3; ++j) {
        // and N is found, with the resolver as Q
        EXPECT_TRUE(n_of(j).detected);
        EXPECT_NEAR(n_of(j).value, 1e-3, 4 * n_of(j).sigma) << j;
        EXPECT_LT(n_of(j).sigma, 0.3e-3);
        const auto& q = monitor_.status().gyros[j].terms[0];
        EXPECT_NEAR(q.value, 5.013, 4 * q.sigma);
        EXPECT_EQ(monitor_.status().gyros[j].in_force, 1e-3);
        EXPECT_GT(monitor_.status().gyros[j].smallest_change, 1.5);
    }
    EXPECT_GE(monitor_.status().dwells, 27U);
    // WHEN it reports, THEN each gyro has a line that says what was not detected and below what
    events_.clear();
    monitor_.report();
    ASSERT_EQ(events_.size(), 3U);
    EXPECT_NE(events_[0].second.find("K not detected, below"), std::string::npos)
        << events_[0].second;
    // and after a new start nothing is known
    monitor_.reset();
    EXPECT_EQ(monitor_.status().dwells, 0U);
}

TEST_F(NoiseMonitorTest, HandsAWrongNToTheFilterInStepsOfTwo) {
    // GIVEN gyros four times noisier than the filter believes
    std::mt19937_64 generator(7002);
    double present = 1e-3;
    int changes = 0;
    for (int d = 0; d < 20; ++d) {
        static_cast<void>(dwell({5.013, 4e-3, 98}, generator));
        const auto levels = monitor_.take_new_levels();
        if (!levels) continue;
        ++changes;
        // THEN not before eight dwells, never by more than a factor of two, and logged
        EXPECT_GE(d, 7);
        EXPECT_LE(levels->gyro_random_walk_deg_per_rt_h[1], 2 * present * (1 + 1e-12));
        present = levels->gyro_random_walk_deg_per_rt_h[1];
    }
    EXPECT_GE(changes, 2);
    EXPECT_NEAR(present, 4e-3, 1.5e-3);
    EXPECT_GE(events_of(Severity::warning), 2);
}

TEST_F(NoiseMonitorTest, AnAlarmFlagsTheDwellAndTeachesNothing) {
    std::mt19937_64 generator(7003);
    for (int d = 0; d < 10; ++d) static_cast<void>(dwell({}, generator));
    const auto taught = monitor_.status().dwells;
    const double before = n_of(0).value;
    // WHEN a dwell is far noisier, THEN it is flagged, named, and changes nothing
    EXPECT_TRUE(dwell({15, 1e-3, 98}, generator));
    EXPECT_EQ(monitor_.status().dwells, taught);
    EXPECT_EQ(n_of(0).value, before);
    EXPECT_FALSE(monitor_.take_new_levels());
    ASSERT_FALSE(monitor_.status().alarms.empty());
    EXPECT_EQ(monitor_.status().alarms.back().position, 11);
    EXPECT_GT(monitor_.status().alarms.back().ratio, monitor_.status().alarms.back().limit);
    EXPECT_GE(events_of(Severity::alarm), 1);
    EXPECT_NE(events_.back().second.find("position 11"), std::string::npos);
}

TEST_F(NoiseMonitorTest, TheSurfaceHasTheNewestDwellsThoseWithAnAlarmToo) {
    std::mt19937_64 generator(7011);
    for (int d = 0; d < 6; ++d) static_cast<void>(dwell({}, generator));
    const auto early = monitor_.status().surface;
    EXPECT_EQ(early->size(), 6U);
    EXPECT_TRUE(dwell({15, 1e-3, 98}, generator));
    const auto& newest = monitor_.status().surface->back();
    EXPECT_EQ(newest.position, 7);
    EXPECT_TRUE(newest.alarm);
    EXPECT_FALSE(early->back().alarm);
    ASSERT_EQ(newest.tau_s.size(), early->back().tau_s.size());
    for (std::size_t j = 0; j < 3; ++j) {
        ASSERT_EQ(newest.deviation_deg_h[j].size(), newest.tau_s.size());
        // Three times the noise of the angle, at the same angles: 96 second differences are 49
        // degrees of freedom, the ratio is known to 14 %; four of those.
        EXPECT_NEAR(newest.deviation_deg_h[j][0] / (*early)[3].deviation_deg_h[j][0], 3, 1.7);
        ASSERT_EQ(newest.classical_deg_h[j].size(), newest.tau_s.size());
        EXPECT_NEAR(newest.classical_deg_h[j][0] / (*early)[3].classical_deg_h[j][0], 3, 1.7);
    }
    // WHEN there are more than are kept, THEN the oldest go, and who has them keeps what it has
    while (position_ < static_cast<int>(NoiseStatus::kMostCurves) + 9)
        static_cast<void>(dwell({5.013, 1e-3, 20}, generator));
    const auto& curves = *monitor_.status().surface;
    ASSERT_EQ(curves.size(), NoiseStatus::kMostCurves);
    EXPECT_EQ(curves.back().position, position_);
    EXPECT_EQ(curves.front().position, position_ + 1 - static_cast<int>(NoiseStatus::kMostCurves));
    EXPECT_EQ(early->size(), 6U);
    monitor_.reset();
    EXPECT_TRUE(monitor_.status().surface->empty());
}

TEST_F(NoiseMonitorTest, AStepOfTheMeanBetweenDwellsRaisesAnAlarm) {
    std::mt19937_64 generator(7005);
    // GIVEN dwells of one kind; the very first is compared with the prior, which says nothing
    for (int d = 0; d < 60; ++d) static_cast<void>(dwell({}, generator));
    // THEN hardly one has alarmed: 60 x 1e-3 expected, all tests together
    EXPECT_LE(monitor_.status().alarms_total, 2U) << "seed 7005";
    const auto before = monitor_.status().alarms_total;
    // WHEN the constant drift of gyro y steps by seven times the 0.007 deg/h that 100 s show
    EXPECT_TRUE(dwell({5.013, 1e-3, 98, {0, -0.05, 0}}, generator));
    // THEN that gyro is named, with the step in standard deviations
    ASSERT_EQ(monitor_.status().alarms_total, before + 1);
    const auto& alarm = monitor_.status().alarms.back();
    EXPECT_EQ(alarm.gyro, 1U);
    EXPECT_EQ(alarm.position, 61);
    EXPECT_STREQ(alarm.reading, "step of the mean between adjacent windows");
    EXPECT_NEAR(alarm.ratio, -0.05 / 0.00699, 4);
    EXPECT_LT(std::abs(alarm.limit), std::abs(alarm.ratio));
    EXPECT_NE(events_.back().second.find("gyro y, run 1 position 61: the mean drift has stepped"),
              std::string::npos)
        << events_.back().second;
    // AND where the coefficients leave as much open, it is no step
    for (std::size_t i = 0; i < estimator::kParameters; i += 10)
        covariance_[i * (estimator::kParameters + 1)] = 0.05 * 0.05;
    EXPECT_FALSE(dwell({}, generator));
    EXPECT_FALSE(dwell({5.013, 1e-3, 98, {0, -0.05, 0}}, generator));
}

TEST_F(NoiseMonitorTest, ALevellingIsOneMoreInnovation) {
    // GIVEN coefficients known to 0.02 deg/h of constant drift, and levellings sure to 0.1
    for (std::size_t i = 0; i < estimator::kParameters; i += 10)
        covariance_[i * (estimator::kParameters + 1)] = 0.02 * 0.02;
    std::mt19937_64 generator(7006);
    static_cast<void>(dwell({}, generator));
    std::normal_distribution<double> normal;
    const estimator::Kinematics kinematics(settings_);
    const estimator::DriftModel model(settings_);
    estimator::ParameterArray parameters{};
    for (std::size_t i = 0; i < estimator::kParameters; ++i)
        parameters[estimator::internal_of(i)] = coefficients_[i];
    constexpr int kLevellings = 200;
    const auto level = [&](double more_deg_h) {
        LevelDrift drift;
        drift.run = 1;
        drift.position = 7;
        drift.encoder_rad = {0.7, 0.2, -0.4};
        drift.direction = {{{1, 0, 0}, {0, 0.8, 0.6}}};
        drift.sigma_deg_h = 0.1;
        const auto pose = kinematics.pose(kinematics.gimbal_angles(drift.encoder_rad));
        const Eigen::Vector3d rate =
            model.platform_rate(pose, model.regressors(pose.up, 1), parameters.data());
        for (std::size_t a = 0; a < 2; ++a) {
            const auto& d = drift.direction[a];
            drift.rate_deg_h[a] = d[0] * rate[0] + d[1] * rate[1] + d[2] * rate[2] + more_deg_h +
                                  std::hypot(0.1, 0.02) * normal(generator);
        }
        monitor_.levelled(drift);
    };
    events_.clear();
    for (int i = 0; i < kLevellings; ++i) level(0);
    // THEN the innovations are as large as said: 400 squares, 99.99 % band
    const auto& found = monitor_.status().level;
    EXPECT_EQ(found.samples, 200U);
    EXPECT_NEAR(found.mean_square, 1, 3.9 * std::sqrt(2.0 / (2 * kLevellings))) << "seed 7006";
    EXPECT_NEAR(found.sigma_deg_h[1], std::hypot(0.1, 0.02), 1e-9);
    EXPECT_LE(events_of(Severity::alarm), 2) << "200 x 1e-3 expected";
    // WHEN the drift is eight standard deviations off, THEN an alarm says where and by how much
    events_.clear();
    level(0.8);
    ASSERT_EQ(events_of(Severity::alarm), 1);
    EXPECT_NE(events_.back().second.find("run 1 position 7: while it was levelled"),
              std::string::npos)
        << events_.back().second;
}

TEST_F(NoiseMonitorTest, LeavesOutWhatCannotBeJudged) {
    std::mt19937_64 generator(7004);
    // too short
    EXPECT_FALSE(dwell({5, 1e-3, 8}, generator));
    // flagged by the filter
    DwellSummary flagged;
    flagged.run = 1;
    flagged.position = ++position_;
    flagged.flagged = true;
    feed({}, generator, flagged);
    EXPECT_FALSE(monitor_.end_dwell(flagged, {coefficients_, covariance_}));
    // no block at all, and blocks of another dwell
    DwellSummary other;
    other.run = 2;
    other.position = 1;
    EXPECT_FALSE(monitor_.end_dwell(other, {coefficients_, covariance_}));
    feed({}, generator, flagged);
    EXPECT_FALSE(monitor_.end_dwell(other, {coefficients_, covariance_}));
    EXPECT_EQ(monitor_.status().dwells, 0U);
    EXPECT_EQ(monitor_.status().dwells_left_out, 4U);
}

}  // namespace
}  // namespace vibrig::noise
