#pragma once

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace vibrig::proto {

/// The JSON in a file. Throws std::runtime_error that names it: it cannot be read, or has none.
[[nodiscard]] inline nlohmann::json read_json(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error(path + ": cannot be read, expected a JSON file");
    nlohmann::json root = nlohmann::json::parse(file, nullptr, false);
    if (root.is_discarded()) throw std::runtime_error(path + ": found no JSON, expected it");
    return root;
}

}  // namespace vibrig::proto
