#pragma once

#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"

namespace vibrig::configuration {

struct Entry;

/// One key, declared once: reading, bounds, --check, --help and the manual come from here. Its
/// default is what the settings struct is initialised with.
struct Key {
    std::string name;    ///< with its section, "site.latitude_deg"
    std::string type;    ///< "number", "integer", ...
    std::string unit;    ///< empty: none
    std::string bounds;  ///< in words; empty: none
    std::string doc;
    /// Takes the value over or adds to the problems; never throws for what a person wrote.
    std::function<void(const Entry&, Configuration&)> read;
    /// As TOML; empty: the key does not apply to this configuration.
    std::function<std::string(Configuration&)> write;
    /// JSON Schema of the value, one object; empty: what follows from the type.
    std::string json{};
};

/// All keys, in the order in which they are shown.
[[nodiscard]] const std::vector<Key>& schema();

// The parts of the schema.
[[nodiscard]] std::vector<Key> identification_keys();
[[nodiscard]] std::vector<Key> response_keys();  ///< of the accelerometers
[[nodiscard]] std::vector<Key> spectrum_keys();
[[nodiscard]] std::vector<Key> uncertainty_keys();
[[nodiscard]] std::vector<Key> campaign_keys();
[[nodiscard]] std::vector<Key> shaker_keys();
[[nodiscard]] std::vector<Key> bus_keys();
[[nodiscard]] std::vector<Key> guard_keys();
[[nodiscard]] std::vector<Key> daemon_keys();
[[nodiscard]] std::vector<Key> interlock_keys();
[[nodiscard]] std::vector<Key> paperwork_keys();
/// One after the other.
[[nodiscard]] std::vector<Key> joined(std::initializer_list<std::vector<Key>> parts);

}  // namespace vibrig::configuration
