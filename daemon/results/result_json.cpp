#include "daemon/results/result_json.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "daemon/results/assessment_json.hpp"
#include "daemon/results/spectrum_json.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "estimator/uncertainty/with_type.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;
using estimator::kParameters;
namespace uncertainty = estimator::uncertainty;

Json number_if(bool exists, double value) { return exists ? number_or_null(value) : Json(nullptr); }

Json parameters(const estimator::Result& result, const uncertainty::Assessment& assessed,
                const uncertainty::MonteCarlo* drawn) {
    Json list = Json::array();
    for (std::size_t i = 0; i < kParameters; ++i) {
        const bool observable = result.observable[i];
        const uncertainty::Coefficient& of = assessed.coefficients[i];
        const double value = assessed.done ? of.value : result.value[i];
        Json one{{"name", estimator::parameter_names()[i]},
                 {"value", number_if(observable, value)},
                 {"sigma", number_if(observable, result.sigma[i])},
                 {"unit", estimator::parameter_unit(i)},
                 {"observable", observable}};
        if (assessed.done) {
            one["value_constant"] = number_if(observable, result.value[i]);
            one.update(coefficient_json(of));
            if (drawn != nullptr) {
                const auto& interval = drawn->coefficients[i];
                one["interval"] = {number_or_null(interval.low), number_or_null(interval.high)};
                one["gum_confirmed"] = interval.confirmed;
            }
        }
        list.push_back(std::move(one));
    }
    return list;
}

Json covariance(const estimator::Result& result) {
    Json rows = Json::array();
    for (std::size_t i = 0; i < kParameters; ++i) {
        Json row = Json::array();
        for (std::size_t j = 0; j < kParameters; ++j) {
            row.push_back(
                number_if(result.observable[i] && result.observable[j], result.covariance[i][j]));
        }
        rows.push_back(std::move(row));
    }
    return rows;
}

Json amplitudes(const estimator::Result& result) {
    Json list = Json::array();
    for (const estimator::RunAmplitude& run : result.amplitudes) {
        list.push_back({{"run", run.run},
                        {"amplitude_g", number_or_null(run.amplitude_g)},
                        {"kappa", number_or_null(run.kappa)},
                        {"sigma_g", number_if(run.sigma_g > 0, run.sigma_g)},
                        // A table at rest has no frequency.
                        {"frequency_hz", number_if(run.frequency_hz > 0, run.frequency_hz)}});
    }
    return list;
}

Json combinations(const estimator::Result& result, const uncertainty::Assessment& assessed) {
    Json list = Json::array();
    for (std::size_t i = 0; i < result.combinations.size(); ++i) {
        const estimator::Combination& combination = result.combinations[i];
        const bool known = i < assessed.combinations.size();
        Json weights = Json::object();
        for (const auto& [name, weight] : combination.weights) {
            weights[name] = number_or_null(weight);
        }
        list.push_back(
            {{"weights", std::move(weights)},
             {"value", number_or_null(known ? assessed.combinations[i].value : combination.value)},
             {"sigma", number_or_null(combination.sigma)}});
        if (known) list.back()["u"] = number_or_null(assessed.combinations[i].u);
    }
    return list;
}

/// With what noise, and what was shown before.
Json identified_anew(const dwells::Live& live) {
    Json list = Json::array();
    for (std::size_t i = 0; i < kParameters; ++i) {
        const bool observable = live.result.observable[i];
        const uncertainty::Coefficient& of = live.assessed.coefficients[i];
        const double value = live.assessed.done ? of.value : live.result.value[i];
        list.push_back({{"name", estimator::parameter_names()[i]},
                        {"value", number_if(observable, value)},
                        {"sigma", number_if(observable, live.result.sigma[i])},
                        {"u", number_if(observable, of.u)}});
    }
    const estimator::NoiseLevels& levels = live.found.levels;
    return {{"noise",
             {{"angle_arcsec", levels.angle_arcsec},
              {"gyro_random_walk_deg_per_rt_h", levels.gyro_random_walk_deg_per_rt_h},
              {"dof", number_or_null(live.found.dof)}}},
            {"live",
             {{"parameters", std::move(list)},
              {"nis", number_or_null(live.result.nis_per_dof)},
              {"verdict", uncertainty::word_of(live.assessed.verdict.level)},
              {"sentence", live.assessed.verdict.sentence}}}};
}

/// The result together with the unit's type, beside `parameters`, which are without it.
Json type_prior(const KnownType& type, const uncertainty::Assessment& assessed) {
    const auto with = uncertainty::with_type(type.of, assessed);
    Json root{{"type", type.name}, {"units", type.of.units}, {"campaigns", type.of.campaigns}};
    if (!with.determined) {
        root.update({{"distance", nullptr}, {"parameters", nullptr}});
        return root;
    }
    root["distance"] = {{"squared", number_or_null(with.distance.squared)},
                        {"dof", with.distance.dof},
                        {"p", number_or_null(with.distance.p)},
                        {"level", uncertainty::kOutsider},
                        {"passes", !with.distance.outside()}};
    Json list = Json::array();
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        list.push_back({{"name", estimator::parameter_names()[i]},
                        {"value", number_or_null(with.value[i])},
                        {"u", number_or_null(with.u[i])},
                        {"unit", estimator::parameter_unit(i)},
                        {"type_mean", type.of.mean(k)},
                        {"type_sigma", std::sqrt(type.of.predicted(k, k))}});
    }
    root["parameters"] = std::move(list);
    return root;
}

Json campaign_json(const CampaignNames& of) {
    return {
        {"name", of.name},
        {"ended", of.ended_utc_ns > 0 ? Json(iso_text(of.ended_utc_ns)) : Json(nullptr)},
        {"unit", {{"type", text_or_null(of.unit_type)}, {"serial", text_or_null(of.unit_serial)}}}};
}

}  // namespace

std::string result_json(const estimator::Result& result, const uncertainty::Assessment& assessed,
                        bool simulated, const uncertainty::MonteCarlo* drawn,
                        const dwells::Live* live, const SpectrumResult* spectrum,
                        const KnownType* type, const CampaignNames* campaign) {
    Json root;
    root["parameters"] = parameters(result, assessed, drawn);
    root["covariance"] = covariance(result);
    root["amplitudes"] = amplitudes(result);
    root["combinations"] = combinations(result, assessed);
    // No sample in the filter: there is no mean.
    root["nis"] = number_if(result.nis_per_dof > 0, result.nis_per_dof);
    root["samples"] = result.samples;
    root["rejected"] = result.rejected;
    root["warnings"] = result.warnings;
    const estimator::CrossCheck& check = result.cross_check;
    root["cross_check"] = check.done
                              ? Json{{"largest_difference_sigma", number_or_null(check.largest)},
                                     {"coefficient", check.coefficient},
                                     {"limit_sigma", estimator::CrossCheck::kLimit},
                                     {"agrees", check.agrees()}}
                              : Json(nullptr);
    if (!assessed.verdict.sentence.empty()) root.update(assessment_json(assessed));
    if (drawn != nullptr) root["monte_carlo"] = monte_carlo_json(*drawn);
    if (live != nullptr) root["identified_anew"] = identified_anew(*live);
    if (spectrum != nullptr) add_spectrum(*spectrum, root);
    if (type != nullptr) root["type_prior"] = type_prior(*type, assessed);
    if (campaign != nullptr) root["campaign"] = campaign_json(*campaign);
    root["instruction_set"] = estimator::instruction_set();
    root["compiler"] = estimator::compiler();
    root["simulated"] = simulated;
    // A warning may carry bytes of a file; a broken sequence must not cost the result.
    return proto::json_text(root);
}

bool all_observable(const estimator::Result& result) {
    return std::ranges::all_of(result.observable, std::identity());
}

}  // namespace vibrig::tool
