#include "daemon/report/compensation.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace vibrig::report {
namespace {

TEST(Compensation, AnAttitudeIsOfTheGimbalsWhateverTheEncodersRead) {
    // GIVEN coefficients, and a rig whose encoders have signs and zeros of their own
    Coefficients of;
    for (std::size_t i = 0; i < of.value.size(); ++i) of.value[i] = 0.01 * static_cast<double>(i);
    of.observable.fill(true);
    of.covariance.assign(of.value.size() * of.value.size(), 0.0);
    estimator::Settings plain, turned;
    turned.encoder_sign = {-1, 1, -1};
    turned.encoder_zero_deg = {12.5, -3.25, 100};
    // WHEN the drift at gimbal angles is predicted THEN it is that of these angles
    const std::array<double, 3> attitude{30, 10, -20};
    EXPECT_EQ(predict(turned, of, attitude, {.kappa = 5}).drift_dph,
              predict(plain, of, attitude, {.kappa = 5}).drift_dph);
}

class Combined : public ::testing::Test {
  protected:
    static constexpr std::size_t kOpen = 3;  // D_Sx

    Combined() {
        filter_.observable.fill(true);
        filter_.observable[kOpen] = false;
        filter_.value.fill(1);
        filter_.sigma.fill(0.01);
        filter_.covariance.assign(kAll * kAll, 0.0);
        for (std::size_t i = 0; i < kAll; ++i)
            filter_.covariance[i * kAll + i] = i == kOpen ? 100 : 1e-4;
        assessed_.done = true;
        assessed_.covariance_combined.setConstant(kAll, kAll, estimator::uncertainty::kNone);
        for (std::size_t i = 0; i < kAll; ++i) {
            if (i == kOpen) continue;
            assessed_.coefficients[i].value = 1.5;
            assessed_.coefficients[i].u = 0.25;
            for (std::size_t j = 0; j < kAll; ++j)
                if (j != kOpen)
                    assessed_.covariance_combined(static_cast<Eigen::Index>(i),
                                                  static_cast<Eigen::Index>(j)) =
                        i == j ? 0.0625 : 0;
        }
    }

    static constexpr std::size_t kAll = estimator::kParameters;
    Coefficients filter_;
    estimator::uncertainty::Assessment assessed_;
};

TEST_F(Combined, OneThatIsNotDeterminedLeavesTheOthersTheirUncertainty) {
    // GIVEN a result of which one coefficient is not determined
    // WHEN it compensates
    const Coefficients c = combined(assessed_, filter_);
    // THEN all others have value and u of the assessment, and that one is as the filter has it
    EXPECT_TRUE(c.combined);
    for (std::size_t i = 0; i < kAll; ++i) {
        EXPECT_EQ(c.value[i], i == kOpen ? 1 : 1.5) << i;
        EXPECT_EQ(c.sigma[i], i == kOpen ? 0.01 : 0.25) << i;
        EXPECT_EQ(c.covariance[i * kAll + i], i == kOpen ? 100 : 0.0625) << i;
    }
    // AND a drift that does not rest on it has the combined uncertainty: h = 1, 0, 1, 0 .. 1 at 0
    const Prediction at = predict({}, c, {0, 0, 0}, {.kappa = 1});
    EXPECT_TRUE(at.determined[0]);
    EXPECT_NEAR(at.residual_dph[0], 0.25 * std::sqrt(3.0), 1e-12);
    EXPECT_NEAR(at.drift_dph[0], 4.5, 1e-12);
}

TEST_F(Combined, WithoutAnAssessmentIsTheFilters) {
    assessed_.done = false;
    const Coefficients c = combined(assessed_, filter_);
    EXPECT_FALSE(c.combined);
    EXPECT_EQ(c.value, filter_.value);
    EXPECT_EQ(c.sigma, filter_.sigma);
}

}  // namespace
}  // namespace vibrig::report
