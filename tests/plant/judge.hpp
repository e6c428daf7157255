#pragma once

#include <string>
#include <vector>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {

struct JudgedCoefficient {
    std::string name;
    std::string unit;
    double truth = 0;
    double estimate = 0;  ///< NaN: not there
    double sigma = 0;     ///< of the estimate: u_a, or sigma where there is no u_a
    double ratio = 0;     ///< (estimate - truth) / sigma
    std::string fault;    ///< empty: within the limit
};

struct Verdict {
    std::vector<JudgedCoefficient> coefficients;  ///< all 30
    bool passed = false;
    std::size_t worst = 0;
};

/// Compares the JSON result of an identification with the truth. Throws PlantError if it is no such
/// result.
[[nodiscard]] Verdict judge(const std::string& result_json, const std::string& file_name,
                            const Truth& truth, double sigma_limit);
[[nodiscard]] std::string table_of(const Verdict& verdict);
/// The same for machines: {"passed", "worst", "coefficients": [..]}; what is not there is null.
[[nodiscard]] std::string json_of(const Verdict& verdict);

}  // namespace vibrig::plant
