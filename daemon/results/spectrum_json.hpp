// A campaign over frequency in a result's JSON, and the model for predictions back out of it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "daemon/results/spectrum_result.hpp"

namespace vibrig::tool {

/// Root `spectrum`, `at_hz` of the parameters and `lines` of the dwells' rates. Of the dwells that
/// were held out it has what was measured beside what the others foretell.
void add_spectrum(const SpectrumResult& spectrum, nlohmann::ordered_json& root);

/// One of a gyro's `mixture`. Throws with what was found and expected.
[[nodiscard]] estimator::spectrum::Hypothesis read_hypothesis(const nlohmann::json& from);

/// Reads from the root `spectrum` of a file of vibrig identify --json, or of result.json, what
/// a prediction needs. Throws with file, key and what was expected.
[[nodiscard]] estimator::spectrum::Model read_model(const nlohmann::json& root,
                                                    const std::string& path);

/// What a result says of itself.
struct ResultVerdict {
    bool doubtful = false, not_valid = false;
    std::string sentence;  ///< "not valid, because ..."
};
/// Of one of an older vibrig, which has none: nothing. Throws with file, key and what was expected.
[[nodiscard]] ResultVerdict read_verdict(const nlohmann::json& root, const std::string& path);

}  // namespace vibrig::tool
