#include "daemon/report/compensation.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace vibrig::report
