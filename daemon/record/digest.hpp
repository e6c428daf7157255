#pragma once

#include <string>

namespace vibrig::record {

/// SHA-256 of a file, hexadecimal. Throws std::runtime_error.
[[nodiscard]] std::string sha256_of_file(const std::string& path);
[[nodiscard]] std::string sha256_of_text(const std::string& text);

}  // namespace vibrig::record
