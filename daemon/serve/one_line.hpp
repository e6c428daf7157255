#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace vibrig::serve {

inline constexpr std::size_t kLongestLine = 1000;  ///< bytes; "..." stands for what is beyond

/// What came from outside, fit for a log, a terminal and an audit: one line of UTF-8. Control
/// characters, line separators and those that turn the direction of writing are escaped, as \n,
/// \x1b, \u202e; bytes that are not UTF-8 become '?'. At most `longest` bytes and "...".
[[nodiscard]] std::string one_line(std::string_view text, std::size_t longest = kLongestLine);

}  // namespace vibrig::serve
