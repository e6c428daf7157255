#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/report/page.hpp"
#include "daemon/report/report.hpp"
#include "daemon/report/sections.hpp"

namespace vibrig::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::size_t kDFx = 0, kDIIx = 4;

class Comparison : public ::testing::Test {
  protected:
    Comparison() {
        now_.assessed.done = then_.assessed.done = true;
        now_.at_hz.fill(15);
        then_.at_hz.fill(15);
        set(kDFx, 1.0, 1.3);
        set(kDIIx, 0.1, 0.5);
        // What the filter has is of noise alone, and of no account here.
        now_.coefficients.observable.fill(true);
        now_.coefficients.sigma.fill(1e-3);
        then_.name = "earlier";
    }
    /// Each with u = 0.1 and U = 0.25: k is not 1.96 where there are few dwells.
    void set(std::size_t i, double now, double then) {
        now_.assessed.coefficients[i].value = now;
        then_.assessed.coefficients[i].value = then;
        for (auto* of : {&now_.assessed.coefficients[i], &then_.assessed.coefficients[i]}) {
            of->u = 0.1;
            of->expanded = 0.25;
        }
    }
    [[nodiscard]] std::string page() const {
        Page page;
        add_comparison(page, campaign_, now_, then_);
        return page.html("x");
    }

    record::Campaign campaign_;
    Analysis now_;
    Earlier then_;
};

TEST_F(Comparison, ScoresAreOfBothExpandedUncertainties) {
    // 0.3 and 0.4 over 0.25 sqrt 2
    EXPECT_THAT(page(), HasSubstr("<td>-0.300000</td><td>deg/h</td><td>-0.85</td>"));
    EXPECT_THAT(page(), HasSubstr("<td>-0.400000</td><td>deg/h/g^2</td><td class=\"bad\">-1.13"));
    EXPECT_THAT(page(), HasSubstr("differences are 2.50 of their expected standard deviations, "
                                  "root mean square; 1 of 2 beyond E_n = 1"));
    EXPECT_THAT(page(), Not(HasSubstr("D_Fy"))) << "what neither determines";
}

TEST_F(Comparison, WhatIsOfAnotherVibrationIsLeftOutAndCounted) {
    then_.at_hz.fill(0);
    EXPECT_THAT(page(), HasSubstr("<td>D_Fx</td>"));
    EXPECT_THAT(page(), Not(HasSubstr("<td>D_IIx</td>")));
    EXPECT_THAT(page(), HasSubstr("Left out: 1 quadratic coefficients"));
}

TEST_F(Comparison, OneVibrationIsWithinTwoPercent) {
    then_.at_hz.fill(15.29);
    EXPECT_THAT(page(), HasSubstr("<td>D_IIx</td>"));
    then_.at_hz.fill(15.31);
    EXPECT_THAT(page(), HasSubstr("Left out: 1 quadratic coefficients"));
}

TEST_F(Comparison, WhatWasDeterminedAtRestIsOfNoFrequency) {
    estimator::Settings settings;
    settings.frequency_hz = 15;
    tool::Assessed found;
    found.assessed.rates.resize(2);
    EXPECT_EQ(frequencies_of(found, settings)[kDIIx], 0);
    found.assessed.rates[1].level_g = 0.5;
    EXPECT_EQ(frequencies_of(found, settings)[kDIIx], 15);
}

TEST_F(Comparison, WithoutAnUncertaintyOfBothThereIsNoScore) {
    then_.assessed.done = false;
    EXPECT_THAT(page(), HasSubstr("E_n cannot be had: the uncertainty of the earlier campaign"));
    EXPECT_THAT(page(), Not(HasSubstr("D_Fx")));
}

}  // namespace
}  // namespace vibrig::report
