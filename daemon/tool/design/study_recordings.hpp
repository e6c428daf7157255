#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace vibrig::tool::studies {

// What `vibrig study merge` prints and writes of recordings that were identified anew.
[[nodiscard]] std::string recordings_table(const nlohmann::ordered_json& result);
/// One row for each coefficient of each recording.
[[nodiscard]] std::string recordings_csv(const nlohmann::ordered_json& result);
void write_recordings_hdf5(const nlohmann::ordered_json& result, const std::string& path);

// And of the proof of a budget.
[[nodiscard]] std::string propagation_table(const nlohmann::ordered_json& result);
[[nodiscard]] std::string propagation_csv(const nlohmann::ordered_json& result);
void write_propagation_hdf5(const nlohmann::ordered_json& result, const std::string& path);

}  // namespace vibrig::tool::studies
