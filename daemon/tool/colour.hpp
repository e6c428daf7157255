#pragma once

#include <string>

namespace vibrig::tool::colour {

/// Standard output is a terminal that shows them, and NO_COLOR is not set (no-color.org).
[[nodiscard]] bool wanted();

/// The text as it is where no colours are wanted.
[[nodiscard]] std::string good(const std::string& text);
[[nodiscard]] std::string warning(const std::string& text);
[[nodiscard]] std::string bad(const std::string& text);
[[nodiscard]] std::string strong(const std::string& text);

}  // namespace vibrig::tool::colour
