#pragma once

#include <toml++/toml.h>

#include <string>

namespace vibrig::study {

/// A value as TOML on one line.
[[nodiscard]] std::string toml_text(const toml::node& node);
/// A number, text, boolean or list of them as JSON; empty: something else.
[[nodiscard]] std::string json_text(const toml::node& node);

}  // namespace vibrig::study
