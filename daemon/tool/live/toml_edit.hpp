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

/// All keys that are no tables, with a comment that stands alone in the line above. Throws
/// std::runtime_error that names the file and the place.
[[nodiscard]] std::vector<TomlValue> values_in(const std::string& text, const std::string& file);

}  // namespace vibrig::tool
