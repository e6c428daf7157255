#pragma once

#include <string>
#include <vector>

namespace vibrig::tool {

struct TomlValue {
    std::string key;      ///< "platform.encoder_sign"
    std::string value;    ///< as TOML has it
    std::string comment;  ///< behind a line that is new; empty: none
};

/// The text with these keys set, everything else as it was. Throws std::runtime_error that names
/// file and key where a person has to do it.
[[nodiscard]] std::string with_values(std::string text, const std::string& file,
                                      const std::vector<TomlValue>& values);

}  // namespace vibrig::tool
