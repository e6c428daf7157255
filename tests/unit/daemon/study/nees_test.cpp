#include "daemon/study/nees.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace vibrig::study {
namespace {

TEST(StudyCampaigns, HaveNoNeesWithoutACovariance) {
    const Eigen::VectorXd error = Eigen::VectorXd::Ones(2);
    Eigen::MatrixXd covariance(2, 2);
    covariance << 4, 0, 0, 1;
    EXPECT_NEAR(nees(error, covariance), 1.25, 1e-15);
    covariance << 1, 2, 2, 1;  // indefinite
    EXPECT_TRUE(std::isnan(nees(error, covariance)));
    covariance << 1, 1, 1, 1 - 1e-9;
    EXPECT_TRUE(std::isnan(nees(error, covariance)));
    EXPECT_TRUE(std::isnan(nees(error, Eigen::MatrixXd())));
}

}  // namespace
}  // namespace vibrig::study
