#include "estimator/uncertainty/freed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/filter/second_moment.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/unit/estimator/rig_simulator.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

// Structural misfits as further unknowns.

namespace vibrig::estimator::uncertainty {
namespace {

using estimator::testing::kTable2;

struct Freed : ::testing::Test {
    Freed() {
        for (std::size_t i = 0; i < kParameters; ++i) truth[internal_of(i)] = kTable2[i];
    }
    /// Rows of a rig that differs by so many sizes of the first unknown of a class.
    [[nodiscard]] std::vector<DwellRow> off_by(Misfit misfit, double sizes) const {
        auto rows = clean;
        const Signatures of =
            signatures(misfit, dwell_table(clean), ForwardModel(settings, truth), 0.007);
        for (std::size_t k = 0; k < rows.size(); ++k)
            mapped(rows[k].rate) +=
                sizes * of.z.col(0).segment<3>(3 * static_cast<Eigen::Index>(k));
        return rows;
    }
    /// u_A over sigma with a class freed: median and largest of 30.
    [[nodiscard]] std::pair<double, double> cost(Misfit misfit) const {
        Settings with = settings;
        with.drift.model = BiasModel::constant;
        with.free = {misfit};
        const Assessment a = assess(with, estimator::testing::result_of(clean));
        std::vector<double> all;
        for (const Coefficient& c : a.coefficients) all.push_back(c.u_a / c.sigma);
        std::sort(all.begin(), all.end());
        return {0.5 * (all[14] + all[15]), all.back()};
    }

    Settings settings;
    std::vector<DwellRow> clean =
        estimator::testing::theory_rows(settings, estimator::testing::balanced(6, 14.0 / 3));
    ParameterArray truth{};
};

TEST_F(Freed, ALatitudeThatIsOffIsFoundAndNoLongerMovesTheCoefficients) {
    constexpr double kArcmin = 6, kSize = 3;
    auto rows = off_by(Misfit::latitude, kArcmin / kSize);
    const std::uint64_t seed = 21;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    estimator::testing::add_noise(rows, random);
    const Result result = estimator::testing::result_of(rows);
    ASSERT_EQ(assess(settings, result).verdict.level, Level::not_valid);

    settings.free = {Misfit::latitude};
    const Assessment a = assess(settings, result);
    EXPECT_EQ(a.verdict.level, Level::valid) << a.verdict.sentence;
    EXPECT_EQ(a.degrees, 53);
    ASSERT_EQ(a.freed.size(), 1U);
    EXPECT_EQ(a.freed[0].of_class, "latitude");
    EXPECT_EQ(a.freed[0].unit, "arcmin");
    EXPECT_NEAR(a.freed[0].sigma, 0.7, 0.1);
    EXPECT_NEAR(a.freed[0].value, kArcmin, 3 * a.freed[0].sigma);
    double square = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const double in_u = (a.coefficients[i].value - kTable2[i]) / a.coefficients[i].u_a;
        square += in_u * in_u / kParameters;
    }
    EXPECT_LT(std::sqrt(square), 1.5);
}

// The gain's spread over noise is what the covariance says, and the value follows from it.
TEST_F(Freed, IsNoMisfitThatCouldHide) {
    auto rows = clean;
    std::mt19937_64 random(3);
    estimator::testing::add_noise(rows, random);
    const auto sentence = [&](std::vector<Misfit> free) {
        Settings with = settings;
        with.free = std::move(free);
        return assess(with, estimator::testing::result_of(rows)).verdict.sentence;
    };
    const auto none = sentence({}), azimuth = sentence({Misfit::azimuth});
    ASSERT_EQ(azimuth.rfind("valid: ", 0), 0U) << azimuth;
    EXPECT_NE(none.find("seen with 90 %: azimuth "), std::string::npos) << none;
    EXPECT_EQ(azimuth.find("azimuth"), std::string::npos) << azimuth;
    EXPECT_NE(azimuth.find("seen with 90 %: motion across"), std::string::npos) << azimuth;
}

TEST_F(Freed, TheGainIsThatOfTheEstimator) {
    settings.free = {Misfit::azimuth, Misfit::cross_axis};
    settings.drift.model = BiasModel::constant;
    const auto rows = off_by(Misfit::azimuth, 0.01);
    const Assessment a = assess(settings, estimator::testing::result_of(rows));
    const Assessment before = assess(settings, estimator::testing::result_of(clean));
    ASSERT_EQ(a.freed.size(), 3U);
    const Eigen::VectorXd change =
        a.gain * (all_rates(dwell_table(rows)) - all_rates(dwell_table(clean)));
    const Eigen::MatrixXd spread = estimator::testing::kRateVariance * a.gain * a.gain.transpose();
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto k = static_cast<Eigen::Index>(internal_of(i));
        EXPECT_NEAR(change[k], a.coefficients[i].value - before.coefficients[i].value,
                    1e-3 * a.coefficients[i].u_a);
        EXPECT_NEAR(std::sqrt(spread(k, k)) / a.coefficients[i].u_a, 1, 0.01);
    }
}

// Motion across the vertical multiplies the coefficients and itself. Noise apart, written out
// here: what the accelerometers do not see is (north, 0, east) of the vertical vibration.
TEST_F(Freed, WhatIsFarOffIsFoundAsItIs) {
    constexpr double kNorth = 0.08, kEast = -0.06;
    auto rows = clean;
    const DriftModel drift(settings);
    const Kinematics kinematics(settings);
    for (DwellRow& row : rows) {
        VibrationMoment moved = row.vibration;
        moved.gamma = {kNorth * kNorth, 1, kEast * kEast, kNorth, kNorth * kEast, kEast};
        const Pose pose = kinematics.pose(mapped(row.angles));
        const Regressors h = drift.regressors(pose.up, second_moment(pose, moved));
        for (std::size_t j = 0; j < kGyros; ++j) {
            for (std::size_t g = 0; g < kGroups; ++g)
                row.rate[j] += (h[g][j] - row.regressors[j][g]) * truth[internal_index(g, j)];
        }
    }
    settings.free = {Misfit::cross_axis};
    const Assessment a = assess(settings, estimator::testing::result_of(rows));
    ASSERT_EQ(a.freed.size(), 2U);
    EXPECT_NEAR(a.freed[0].value, kNorth, 0.1 * a.freed[0].sigma);
    EXPECT_NEAR(a.freed[1].value, kEast, 0.1 * a.freed[1].sigma);
    for (std::size_t i = 0; i < kParameters; ++i)
        EXPECT_NEAR(a.coefficients[i].value, kTable2[i], 0.1 * a.coefficients[i].u_a)
            << parameter_names()[i];
}

// What cannot be found is not believed.
TEST_F(Freed, RatesThatNoUnknownExplainsAreNotValid) {
    auto rows = clean;
    for (DwellRow& row : rows) row.rate[0] *= 1e6;
    settings.free = {Misfit::cross_axis, Misfit::encoder_zero};
    const Assessment a = assess(settings, estimator::testing::result_of(rows));
    EXPECT_FALSE(a.freed_settled);
    EXPECT_NE(std::ranges::find(a.verdict.reasons, "freed", &Reason::code),
              a.verdict.reasons.end());
    EXPECT_EQ(a.verdict.level, Level::not_valid) << a.verdict.sentence;
}

TEST_F(Freed, CostsSigmaAsTheoryHasIt) {
    struct Row {
        Misfit misfit;
        double median, largest;
    };
    for (const Row& row : {Row{Misfit::azimuth, 1.00, 1.15}, Row{Misfit::latitude, 1.00, 1.33},
                           Row{Misfit::time_base, 1.00, 1.30}, Row{Misfit::cross_axis, 1.04, 1.34},
                           Row{Misfit::cubic, 1.30, 3.6}, Row{Misfit::encoder_zero, 1.15, 3.4},
                           Row{Misfit::non_orthogonality, 1.03, 6.3}}) {
        const auto [median, largest] = cost(row.misfit);
        const char* name = kStructuralNames[static_cast<std::size_t>(row.misfit)];
        EXPECT_NEAR(median, row.median, 0.02 * row.median) << name;
        EXPECT_NEAR(largest, row.largest, 0.03 * row.largest) << name;
    }
}

TEST_F(Freed, IsNotDeclaredAsWell) {
    settings.free = {Misfit::latitude, Misfit::resolver_16};
    const Assessment a = assess(settings, estimator::testing::result_of(clean));
    for (const Contribution& part : a.coefficients[0].budget) {
        EXPECT_NE(part.input, "latitude");
        EXPECT_EQ(part.element.find("16 per turn"), std::string::npos) << part.element;
    }
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
