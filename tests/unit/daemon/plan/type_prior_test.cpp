#include "daemon/plan/type_prior.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

#include "daemon/plan/adaptive.hpp"
#include "daemon/results/result_json.hpp"
#include "estimator/uncertainty/with_type.hpp"
#include "tests/unit/estimator/uncertainty/theory_rows.hpp"

namespace vibrig::plan {
namespace {

using estimator::kParameters;
using nlohmann::json;

/// About a unit: so many of its type, each coefficient with this scatter over its magnitude.
TypePrior type_about(const std::array<double, kParameters>& unit, double scatter) {
    TypePrior out;
    out.type = "GP-3";
    out.of.units = 40;
    out.of.campaigns = 90;
    const auto size = static_cast<Eigen::Index>(kParameters);
    out.of.mean = Eigen::Map<const Eigen::VectorXd>(unit.data(), size);
    const Eigen::VectorXd sigma = (scatter * out.of.mean).cwiseAbs().array() + 1e-9;
    out.of.between = sigma.cwiseAbs2().asDiagonal();
    out.of.within = 0.01 * out.of.between;
    out.of.predicted = 1.1 * out.of.between;
    return out;
}

estimator::Result result_with_noise(std::uint64_t seed, std::size_t dwells) {
    const estimator::Settings settings;
    std::mt19937_64 random(seed);
    auto rows =
        estimator::testing::theory_rows(settings, estimator::testing::balanced(6, 14 / 3.0));
    estimator::testing::add_noise(rows, random);
    rows.resize(std::min(rows.size(), dwells));
    return estimator::testing::result_of(rows);
}

std::vector<double> diagonal(double sigma) {
    std::vector<double> out(kParameters * kParameters, 0.0);
    for (std::size_t i = 0; i < kParameters; ++i) out[i * (kParameters + 1)] = sigma * sigma;
    return out;
}

TEST(TypePrior, ComesThroughItsJsonAsItWas) {
    std::array<double, kParameters> values{};
    for (std::size_t i = 0; i < kParameters; ++i) values[i] = 0.1 * static_cast<double>(i + 1);
    TypePrior before = type_about(values, 0.1);
    before.of.predicted(3, 1) = before.of.predicted(1, 3) = 1e-3;
    const TypePrior after = type_prior_of(to_json(before));
    EXPECT_EQ(after.type, "GP-3");
    EXPECT_EQ(after.of.units, 40U);
    EXPECT_EQ(after.of.campaigns, 90U);
    EXPECT_EQ(after.of.mean, before.of.mean);
    EXPECT_EQ(after.of.predicted, before.of.predicted);
    EXPECT_EQ(after.of.between, before.of.between);
    EXPECT_EQ(after.of.within, before.of.within);
    // AND what is not one is refused with what is wrong
    json broken = json::parse(to_json(before));
    broken["covariance_expected"].erase(0);
    for (const std::string& text : {std::string("{}"), std::string("nothing"), broken.dump()})
        EXPECT_THROW(static_cast<void>(type_prior_of(text)), std::runtime_error) << text;
    broken = json::parse(to_json(before));
    broken["units"] = 9;
    EXPECT_THROW(static_cast<void>(type_prior_of(broken.dump())), std::runtime_error);
}

TEST(TypePrior, JoinsAUnitThatPassesAndLeavesOneThatDoesNotToItsDwells) {
    const estimator::Settings settings;
    const auto result = result_with_noise(2, 28);
    const auto assessed = estimator::uncertainty::assess(settings, result);
    std::array<double, kParameters> values{};
    for (std::size_t i = 0; i < kParameters; ++i) values[i] = assessed.coefficients[i].value;
    // GIVEN a type whose scatter is near what the campaign tells
    const TypePrior like = type_about(values, 0.01);
    const auto start = start_of(like, diagonal(1), settings, result);
    EXPECT_NE(start.words.find("with 40 units of its type"), std::string::npos) << start.words;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const double u = assessed.coefficients[i].u_a;
        EXPECT_LT(start.covariance[i * (kParameters + 1)], u * u);
        EXPECT_GT(start.covariance[i * (kParameters + 1)], 0);
    }
    // AND one that this unit is none of: ten of its scatters away in one coefficient
    TypePrior other = like;
    other.of.mean(4) *= 1.3;
    const auto alone = start_of(other, diagonal(1), settings, result);
    EXPECT_EQ(alone.covariance, diagonal(1));
    EXPECT_NE(alone.words.find("left aside"), std::string::npos) << alone.words;
}

TEST(TypePrior, OfAFewDwellsGoesByTheFilter) {
    const estimator::Settings settings;
    auto result = result_with_noise(3, kFewestDwells - 1);
    std::array<double, kParameters> values{};
    values.fill(0.5);
    const TypePrior like = type_about(values, 0.2);
    result.value = values;
    // sigma 0.1 each, joined with a variance of 1.1 (0.1)^2
    const auto start = start_of(like, diagonal(0.1), settings, result);
    EXPECT_NEAR(start.covariance[0], 0.01 * 0.011 / 0.021, 1e-6);
}

TEST(TypePrior, IsGivenBesideTheResultAndNotInItsPlace) {
    const estimator::Settings settings;
    const auto result = result_with_noise(4, 28);
    const auto assessed = estimator::uncertainty::assess(settings, result);
    std::array<double, kParameters> values{};
    for (std::size_t i = 0; i < kParameters; ++i) values[i] = assessed.coefficients[i].value;
    const TypePrior like = type_about(values, 0.01);
    const tool::KnownType known{like.type, like.of};
    const json with =
        json::parse(tool::result_json(result, assessed, true, nullptr, nullptr, nullptr, &known));
    const json without = json::parse(tool::result_json(result, assessed, true));
    EXPECT_EQ(with.at("parameters"), without.at("parameters"));
    EXPECT_FALSE(without.contains("type_prior"));
    const json& type = with.at("type_prior");
    EXPECT_EQ(type.at("units"), 40);
    EXPECT_EQ(type.at("distance").at("passes"), true);
    ASSERT_EQ(type.at("parameters").size(), kParameters);
    for (std::size_t i = 0; i < kParameters; ++i) {
        EXPECT_LT(type.at("parameters")[i].at("u").get<double>(), assessed.coefficients[i].u);
        // What is wrong in every campaign alike stays whole.
        EXPECT_GE(type.at("parameters")[i].at("u").get<double>(),
                  0.99 * assessed.coefficients[i].u_b);
    }
    // AND of a campaign that did not determine all it says that there is nothing to join
    const tool::KnownType same{like.type, like.of};
    const json none =
        json::parse(tool::result_json(result, {}, true, nullptr, nullptr, nullptr, &same));
    EXPECT_TRUE(none.at("type_prior").at("parameters").is_null());
}

}  // namespace
}  // namespace vibrig::plan
