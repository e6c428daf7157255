#include "daemon/plan/type_prior.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/plan/adaptive.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "proto/json_text.hpp"
#include "proto/printed.hpp"

namespace vibrig::plan {

namespace uncertainty = estimator::uncertainty;
using OrderedJson = nlohmann::ordered_json;
using Eigen::Index;

namespace {

constexpr auto kSize = static_cast<Index>(estimator::kParameters);
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

OrderedJson lower_triangle(const Eigen::MatrixXd& of) {
    OrderedJson list = OrderedJson::array();
    for (Index i = 0; i < of.rows(); ++i)
        for (Index j = 0; j <= i; ++j) list.push_back(of(i, j));
    return list;
}

Eigen::MatrixXd matrix_of(const OrderedJson& list, const char* name) {
    const auto numbers = list.get<std::vector<double>>();
    if (static_cast<Index>(numbers.size()) != kSize * (kSize + 1) / 2)
        throw std::runtime_error(std::string(name) + ": found " + std::to_string(numbers.size()) +
                                 " numbers, expected " + std::to_string(kSize * (kSize + 1) / 2));
    Eigen::MatrixXd out(kSize, kSize);
    std::size_t at = 0;
    for (Index i = 0; i < kSize; ++i)
        for (Index j = 0; j <= i; ++j) out(i, j) = out(j, i) = numbers[at++];
    return out;
}

/// As it is known so far: with few dwells by the filter, then as it will be reported.
uncertainty::Found known(const std::vector<double>& measured, const estimator::Settings& settings,
                         const estimator::Result& result) {
    uncertainty::Found found{Eigen::Map<const Eigen::VectorXd>(result.value.data(), kSize),
                             Eigen::Map<const RowMajor>(measured.data(), kSize, kSize)};
    if (result.rows.size() < kFewestDwells) return found;
    const auto assessed = uncertainty::assess(settings, result);
    if (!assessed.done || !assessed.covariance_a.allFinite()) return found;
    Eigen::VectorXd value(kSize);
    for (Index i = 0; i < kSize; ++i)
        value(i) = assessed.coefficients[static_cast<std::size_t>(i)].value;
    if (!value.allFinite()) return found;
    return {value, assessed.covariance_a};
}

}  // namespace

std::string to_json(const TypePrior& prior) {
    const auto& of = prior.of;
    OrderedJson coefficients = OrderedJson::array();
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto k = static_cast<Index>(i);
        coefficients.push_back({{"name", estimator::parameter_names()[i]},
                                {"unit", estimator::parameter_unit(i)},
                                {"mean", of.mean(k)},
                                {"between_units", std::sqrt(of.between(k, k))},
                                {"between_campaigns", std::sqrt(of.within(k, k))},
                                {"expected_sigma", std::sqrt(of.predicted(k, k))}});
    }
    return proto::json_text(OrderedJson{{"type", prior.type},
                                        {"simulated", prior.simulated},
                                        {"units", of.units},
                                        {"campaigns", of.campaigns},
                                        {"vibration", prior.vibration},
                                        {"of_other_vibration", prior.of_other_vibration},
                                        {"coefficients", std::move(coefficients)},
                                        {"covariance_between_units", lower_triangle(of.between)},
                                        {"covariance_between_campaigns", lower_triangle(of.within)},
                                        {"covariance_expected", lower_triangle(of.predicted)}});
}

TypePrior type_prior_of(const std::string& json) {
    TypePrior prior;
    try {
        const OrderedJson root = OrderedJson::parse(json);
        prior.type = root.at("type").get<std::string>();
        prior.simulated = root.at("simulated").get<bool>();
        prior.of.units = root.at("units").get<std::size_t>();
        prior.of.campaigns = root.at("campaigns").get<std::size_t>();
        const OrderedJson& coefficients = root.at("coefficients");
        if (static_cast<Index>(coefficients.size()) != kSize)
            throw std::runtime_error("coefficients: found " + std::to_string(coefficients.size()) +
                                     ", expected " + std::to_string(kSize));
        prior.of.mean.resize(kSize);
        for (Index i = 0; i < kSize; ++i)
            prior.of.mean(i) = coefficients[static_cast<std::size_t>(i)].at("mean").get<double>();
        prior.of.between = matrix_of(root.at("covariance_between_units"), "between units");
        prior.of.within = matrix_of(root.at("covariance_between_campaigns"), "between campaigns");
        prior.of.predicted = matrix_of(root.at("covariance_expected"), "expected");
    } catch (const OrderedJson::exception& error) {
        throw std::runtime_error(std::string("a type's statistics: ") + error.what());
    }
    if (prior.of.units < uncertainty::kFewestUnits)
        throw std::runtime_error("a type's statistics: found " + std::to_string(prior.of.units) +
                                 " units, expected at least " +
                                 std::to_string(uncertainty::kFewestUnits));
    return prior;
}

Start start_of(const TypePrior& prior, std::vector<double> measured,
               const estimator::Settings& settings, const estimator::Result& result) {
    const auto found = known(measured, settings, result);
    const auto far = uncertainty::distance(prior.of, found);
    if (far.outside())
        return {
            std::move(measured),
            proto::printed("; the type is left aside: p = %.2g that one of its units is like this",
                           far.p)};
    const RowMajor joined = uncertainty::with_type(prior.of, found).covariance;
    return {{joined.data(), joined.data() + joined.size()},
            proto::printed("; with %zu units of its type, p = %.2g", prior.of.units, far.p)};
}

}  // namespace vibrig::plan
