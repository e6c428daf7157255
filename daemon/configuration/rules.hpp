#pragma once

#include <string>

namespace vibrig::configuration {

// Rules for texts: empty if the text is fine, else what was expected.

/// A name that may become a folder: letters, digits, space, '.', '_', '-', not starting with '.'.
[[nodiscard]] std::string campaign_name_rule(const std::string& text);
/// As the kernel takes it: 1 to 15 characters, no '/', no blanks.
[[nodiscard]] std::string interface_rule(const std::string& text);
/// Empty, absolute, or "@name" for the abstract name space; at most 107 bytes.
[[nodiscard]] std::string socket_rule(const std::string& text);
[[nodiscard]] std::string socket_or_empty_rule(const std::string& text);
/// Absolute: an abstract name has no mode, so that anybody may open it.
[[nodiscard]] std::string socket_file_rule(const std::string& text);
[[nodiscard]] std::string socket_file_or_empty_rule(const std::string& text);
/// Empty, or "HOST:PORT", "[::1]:PORT".
[[nodiscard]] std::string endpoint_rule(const std::string& text);
[[nodiscard]] std::string group_rule(const std::string& text);
[[nodiscard]] std::string path_rule(const std::string& text);
/// Not empty.
[[nodiscard]] std::string folder_rule(const std::string& text);
[[nodiscard]] std::string host_rule(const std::string& text);
[[nodiscard]] std::string host_or_empty_rule(const std::string& text);
/// No control characters, 256 bytes at most.
[[nodiscard]] std::string line_rule(const std::string& text);
/// No control characters, 120 bytes at most.
[[nodiscard]] std::string short_text_rule(const std::string& text);
/// "Message.Signal", or empty for not bound.
[[nodiscard]] std::string binding_rule(const std::string& text);
/// A C identifier, as DBC files name messages and signals.
[[nodiscard]] std::string identifier_rule(const std::string& text);
[[nodiscard]] std::string identifier_or_empty_rule(const std::string& text);

}  // namespace vibrig::configuration
