#include "daemon/report/sections.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>

#include "daemon/record/campaign_file.hpp"
#include "daemon/report/page.hpp"

namespace vibrig::report {
namespace {

using ::testing::HasSubstr;

// As recordings may lie.
TEST(FilterSection, IsWrittenOfEstimatesWithoutSamples) {
    record::Campaign campaign;
    campaign.estimates.resize(3);
    for (std::size_t i = 0; i < campaign.estimates.size(); ++i) {
        campaign.estimates[i].time = static_cast<drivers::Time>(i) * drivers::kSecond;
        campaign.estimates[i].value.fill(1);
        campaign.estimates[i].sigma.fill(1);
    }
    Analysis analysis;
    analysis.coefficients.value.fill(1);
    analysis.coefficients.sigma.fill(1);
    Page page;
    add_convergence(page, campaign, analysis);
    EXPECT_THAT(page.html("a"), HasSubstr("standard deviation"));
}

TEST(FilterSection, IsWrittenOfInnovationsOfWhichNoneIsShown) {
    Analysis analysis;
    analysis.innovations.count = 5;
    Page page;
    add_innovations(page, analysis);
    EXPECT_THAT(page.html("a"), HasSubstr("Normalised innovations squared"));
}

}  // namespace
}  // namespace vibrig::report
