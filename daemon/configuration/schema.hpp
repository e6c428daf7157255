#pragma once

#include <toml++/toml.h>

#include <functional>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/problems.hpp"

namespace vibrig::configuration {

/// One key, declared once: reading, bounds, --check, --help and the manual come from here. Its
/// default is what the settings struct is initialised with.
struct Key {
    std::string name;    ///< with its section, "site.latitude_deg"
    std::string type;    ///< "number", "integer", ...
    std::string unit;    ///< empty: none
    std::string bounds;  ///< in words; empty: none
    std::string doc;
    /// Takes the value over or adds to the problems; never throws for what a person wrote.
    std::function<void(const toml::node&, Configuration&, Problems&)> read;
    /// As TOML; empty: the key does not apply to this configuration.
    std::function<std::string(Configuration&)> write;
    /// JSON Schema of the value, one object; empty: what follows from the type.
    std::string json{};
};

/// All keys, in the order in which they are shown.
[[nodiscard]] const std::vector<Key>& schema();

// The parts of the schema.
void add_identification_keys(std::vector<Key>& keys);
void add_response_keys(std::vector<Key>& keys);  ///< of the accelerometers
void add_spectrum_keys(std::vector<Key>& keys);
void add_uncertainty_keys(std::vector<Key>& keys);
void add_campaign_keys(std::vector<Key>& keys);
void add_shaker_keys(std::vector<Key>& keys);
void add_bus_keys(std::vector<Key>& keys);
void add_guard_keys(std::vector<Key>& keys);
void add_daemon_keys(std::vector<Key>& keys);
void add_interlock_keys(std::vector<Key>& keys);
void add_paperwork_keys(std::vector<Key>& keys);

}  // namespace vibrig::configuration
