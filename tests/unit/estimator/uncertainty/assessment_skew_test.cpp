// Accelerometers that are not read at one time, in rows of whole campaigns.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <iostream>
#include <numbers>
#include <random>
#include <string>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/second_moment.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::kTable2;
using Complex = std::complex<double>;
using Motion = std::array<Complex, 3>;  ///< of the base: north, up (1), east

constexpr double kSkewHz = 15;
constexpr int kSkewSeeds = 20;
constexpr const char* kSkewCode = "accelerometer skew";

/// Second moment of such a sine, over its vertical part.
LevelTensor moment_shape(const Eigen::Vector3cd& f) {
    const auto of = [&](int a, int b) { return (f[a] * std::conj(f[b])).real() / std::norm(f[1]); };
    return {of(0, 0), 1, of(2, 2), of(0, 1), of(0, 2), of(1, 2)};
}

/// Rates of what the base does, regressors of what accelerometers show of it that are late by so
/// much; `noise`: of the shape.
struct Skewed {
    Motion base{0, 1, 0};
    std::array<double, 3> late_ms{};

    [[nodiscard]] std::vector<DwellRow> rows(
        const Settings& settings, const std::vector<estimator::testing::PlannedRow>& plan) const {
        auto rows = estimator::testing::theory_rows(settings, plan);
        const Kinematics kinematics(settings);
        const DriftModel model(settings);
        ParameterArray coefficients{};
        for (std::size_t i = 0; i < kParameters; ++i) coefficients[internal_of(i)] = kTable2[i];
        for (DwellRow& row : rows) {
            const Pose pose = kinematics.pose(mapped(row.angles));
            const Eigen::Vector3cd moves(base[0], base[1], base[2]);
            Eigen::Vector3cd read = pose.level.cast<Complex>() * moves;
            for (int k = 0; k < 3; ++k)
                read[k] *= std::polar(
                    1.0, -2e-3 * std::numbers::pi * kSkewHz * late_ms[static_cast<std::size_t>(k)]);
            const Eigen::Vector3cd shown = pose.level.transpose().cast<Complex>() * read;
            const VibrationMoment truth{row.vibration.kappa, moment_shape(moves)};
            row.vibration = {1 + (truth.kappa - 1) * std::norm(shown[1]), moment_shape(shown)};
            const Regressors h = model.regressors(pose.up, second_moment(pose, truth));
            const Regressors seen = model.regressors(pose.up, second_moment(pose, row.vibration));
            for (std::size_t j = 0; j < kGyros; ++j) {
                row.rate[j] = 0;
                for (std::size_t g = 0; g < kGroups; ++g) {
                    row.regressors[j][g] = seen[g][j];
                    row.rate[j] += h[g][j] * coefficients[internal_index(g, j)];
                }
            }
        }
        return rows;
    }
};

struct SkewFound {
    int none = 0, doubtful = 0, not_valid = 0;
    double ms = 0;         ///< the last
    double least_u = 1e9;  ///< of the largest effect
};

/// 5e-6 of the shape is what a dwell of 100 s is known to; `spikes`: of 5 g in one reading of a
/// thousand of each axis.
SkewFound skew_found(const Skewed& rig, double first_g, double second_g,
                     const Settings& settings = {}, bool spikes = false, double declared = 0) {
    const auto clean =
        rig.rows(settings, second_g > 0 ? estimator::testing::balanced(first_g, second_g)
                                        : estimator::testing::balanced_with_rest(first_g));
    SkewFound out;
    for (int seed = 1; seed <= kSkewSeeds; ++seed) {
        auto rows = clean;
        std::mt19937_64 random(static_cast<std::uint64_t>(seed));
        std::normal_distribution<double> normal(0, 1e-5);
        std::poisson_distribution<int> spike(4000 * 1e-3);
        for (DwellRow& row : rows) {
            row.relative_error = declared;
            for (const std::size_t k : {0U, 2U, 3U, 4U, 5U})
                row.vibration.gamma[k] += normal(random);
            for (const std::size_t k : {0U, 2U})
                if (spikes && row.vibration.kappa > 1)
                    row.vibration.gamma[k] +=
                        25.0 / 4000 * spike(random) / (row.vibration.kappa - 1);
        }
        estimator::testing::add_noise(rows, random);
        const Assessment a = assess(settings, estimator::testing::result_of(std::move(rows)));
        const Reason* reason = nullptr;
        for (const Reason& one : a.verdict.reasons)
            if (one.code == kSkewCode) reason = &one;
        ++(reason == nullptr                   ? out.none
           : reason->level == Level::not_valid ? out.not_valid
                                               : out.doubtful);
        if (reason == nullptr) continue;
        out.ms = reason->size;
        out.least_u = std::min(out.least_u, reason->largest_effect_u);
        if (seed == 1) std::cout << reason->text << '\n';
    }
    return out;
}

TEST(AccelerometerSkew, MotionAcrossTheVerticalIsNone) {
    constexpr Complex kAhead{0, 1};
    for (const double share : {0.05, 0.1}) {
        for (const Motion& base :
             {Motion{0, 1, 0}, Motion{share, 1, share}, Motion{share * kAhead, 1, 0},
              Motion{share, 1, -share * kAhead}, Motion{share * kAhead, 1, share * kAhead}}) {
            EXPECT_EQ(skew_found({base}, 6, 14.0 / 3).none, kSkewSeeds) << share;
            if (share > 0.05) {
                EXPECT_EQ(skew_found({base}, 6, 0).none, kSkewSeeds);
            }
        }
    }
    EXPECT_EQ(skew_found({}, 6, 14.0 / 3, {}, true).none, kSkewSeeds);
}

TEST(AccelerometerSkew, OneAxisThatIsReadLateIsSeen) {
    for (const double second_g : {14.0 / 3, 0.0}) {
        constexpr std::array<double, 3> kLate_ms{25, 10, 6};  ///< x, y, z
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double ms = kLate_ms[axis];
            Skewed rig{{0.05, 1, Complex(0, 0.1)}};
            rig.late_ms[axis] = ms;
            const SkewFound found = skew_found(rig, 6, second_g);
            EXPECT_EQ(found.not_valid, kSkewSeeds) << ms << " ms, axis " << axis;
            EXPECT_NEAR(found.ms, ms, 0.1 * ms) << axis;
        }
    }
}

TEST(AccelerometerSkew, ALittleOfItIsDoubtfulAndWhatIsDeclaredIsTakenIntoU) {
    Skewed rig;
    rig.late_ms = {0, 0, 1.8};
    EXPECT_EQ(skew_found(rig, 6, 14.0 / 3).doubtful, kSkewSeeds);
    rig.late_ms = {0, 0, 0.5};
    EXPECT_EQ(skew_found(rig, 6, 14.0 / 3).none, kSkewSeeds);
    Settings settings;
    settings.accelerometer_response.skew_ms = 5;
    rig.late_ms = {0, 0, 4.9};
    const double declared = settings.accelerometer_response.skew_error(kSkewHz);
    EXPECT_EQ(skew_found(rig, 6, 14.0 / 3, settings, false, declared).none, kSkewSeeds);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
