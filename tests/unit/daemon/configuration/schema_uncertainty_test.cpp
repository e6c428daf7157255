#include "tests/unit/daemon/configuration/support.hpp"

// What is declared of a rig: a budget that is none has no place in a result.

namespace vibrig::configuration {
namespace {

using estimator::uncertainty::Misfit;
using ::testing::HasSubstr;

TEST(DeclaredInputs, ThatAreNoBudgetAreRefusedByKeyAndValue) {
    const auto said = [](const std::string& line) { return complaint("[uncertainty]\n" + line); };
    EXPECT_THAT(said("latitude_arcsec = -1"), HasSubstr("uncertainty.latitude_arcsec"));
    EXPECT_THAT(said("azimuth_arcsec = nan"), HasSubstr("uncertainty.azimuth_arcsec"));
    EXPECT_THAT(said("azimuth_arcsec = { u = 5, shape = \"round\" }"), HasSubstr("\"round\""));
    EXPECT_THAT(said("time_base = { u = 1e-5, half_width = 1e-5, shape = \"rectangular\" }"),
                HasSubstr("both u and half_width"));
    EXPECT_THAT(said("correlation = [[\"latitude\", \"azimuth\", 1.5]]"),
                HasSubstr("uncertainty.correlation[0][2]"));
    EXPECT_THAT(said("encoder_zero_arcsec = [1, 2]"), HasSubstr("uncertainty.encoder_zero_arcsec"));
}

TEST(FreedClasses, AreNamedAsTheVerdictNamesThem) {
    const auto c = accepted("[estimator]\nfree = [\"azimuth\", \"resolver, 16 per turn\"]");
    EXPECT_EQ(c.estimator.free, (std::vector<Misfit>{Misfit::azimuth, Misfit::resolver_16}));
    EXPECT_TRUE(accepted("").estimator.free.empty());
}

TEST(FreedClasses, ThatAreUnknownOrThereTwiceAreRefused) {
    const std::string unknown = complaint("[estimator]\nfree = [\"azimut\"]");
    EXPECT_THAT(unknown, HasSubstr("estimator.free[0]"));
    EXPECT_THAT(unknown, HasSubstr("\"azimuth\""));
    EXPECT_THAT(complaint("[estimator]\nfree = [\"step\"]"), HasSubstr("estimator.free[0]"));
    EXPECT_THAT(complaint("[estimator]\nfree = [\"latitude\", \"latitude\"]"),
                HasSubstr("estimator.free[1]"));
    EXPECT_THAT(complaint("[estimator]\nfree = [3]"), HasSubstr("estimator.free[0]"));
}

}  // namespace
}  // namespace vibrig::configuration
