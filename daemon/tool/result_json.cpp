#include "daemon/tool/result_json.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "estimator/instruction_set.hpp"
#include "estimator/result.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;
using estimator::kParameters;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json number_if(bool exists, double value) { return exists ? number(value) : Json(nullptr); }

Json parameters(const estimator::Result& result) {
    Json list = Json::array();
    for (std::size_t i = 0; i < kParameters; ++i) {
        const bool observable = result.observable[i];
        list.push_back({{"name", estimator::parameter_names()[i]},
                        {"value", number_if(observable, result.value[i])},
                        {"sigma", number_if(observable, result.sigma[i])},
                        {"unit", estimator::parameter_unit(i)},
                        {"observable", observable}});
    }
    return list;
}

Json covariance(const estimator::Result& result) {
    Json rows = Json::array();
    for (std::size_t i = 0; i < kParameters; ++i) {
        Json row = Json::array();
        for (std::size_t j = 0; j < kParameters; ++j) {
            row.push_back(number_if(result.observable[i] && result.observable[j],
                                    result.covariance(static_cast<int>(i), static_cast<int>(j))));
        }
        rows.push_back(std::move(row));
    }
    return rows;
}

Json amplitudes(const estimator::Result& result) {
    Json list = Json::array();
    for (const estimator::RunAmplitude& run : result.amplitudes) {
        list.push_back({{"run", run.run},
                        {"amplitude_g", number(run.amplitude_g)},
                        {"kappa", number(run.kappa)},
                        {"sigma_g", number_if(run.sigma_g > 0, run.sigma_g)},
                        // A table at rest has no frequency.
                        {"frequency_hz", number_if(run.frequency_hz > 0, run.frequency_hz)}});
    }
    return list;
}

Json combinations(const estimator::Result& result) {
    Json list = Json::array();
    for (const estimator::Combination& combination : result.combinations) {
        Json weights = Json::object();
        for (const auto& [name, weight] : combination.weights) {
            weights[name] = number(weight);
        }
        list.push_back({{"weights", std::move(weights)},
                        {"value", number(combination.value)},
                        {"sigma", number(combination.sigma)}});
    }
    return list;
}

}  // namespace

std::string result_json(const estimator::Result& result) {
    Json root;
    root["parameters"] = parameters(result);
    root["covariance"] = covariance(result);
    root["amplitudes"] = amplitudes(result);
    root["combinations"] = combinations(result);
    // No sample in the filter: there is no mean.
    root["nis"] = number_if(result.nis_per_dof > 0, result.nis_per_dof);
    root["samples"] = result.samples;
    root["rejected"] = result.rejected;
    root["warnings"] = result.warnings;
    const estimator::CrossCheck& check = result.cross_check;
    root["cross_check"] = check.done ? Json{{"largest_difference_sigma", number(check.largest)},
                                            {"coefficient", check.coefficient},
                                            {"limit_sigma", estimator::CrossCheck::kLimit},
                                            {"agrees", check.agrees()}}
                                     : Json(nullptr);
    root["instruction_set"] = estimator::instruction_set();
    root["compiler"] = estimator::compiler();
    // A warning may carry bytes of a file; a broken sequence must not cost the result.
    return root.dump(-1, ' ', false, Json::error_handler_t::replace);
}

bool all_observable(const estimator::Result& result) {
    return std::all_of(result.observable.begin(), result.observable.end(),
                       [](bool b) { return b; });
}

}  // namespace vibrig::tool
