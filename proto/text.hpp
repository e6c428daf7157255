#pragma once

#include <charconv>
#include <cstddef>
#include <string>
#include <string_view>

namespace vibrig::proto {

/// Bytes of what is quoted in a message; of a line of a log or an audit.
inline constexpr std::size_t kQuotedLength = 40, kLongestLine = 1000;

/// What came from outside, fit for a message, a log and a terminal: one line of UTF-8. Control
/// characters, line separators and those that turn the direction of writing are escaped, as \n,
/// \x1b, \u202e; bytes that are not UTF-8 as \xff. At most `longest` bytes and "...".
[[nodiscard]] std::string printable(std::string_view text, std::size_t longest = kQuotedLength);
/// The same text with a '?' for each byte that is not UTF-8: it must not spoil a whole answer or
/// page.
[[nodiscard]] std::string mend_utf8(std::string_view text);
[[nodiscard]] std::string_view without_byte_order_mark(std::string_view text) noexcept;
[[nodiscard]] bool is_utf8(std::string_view text) noexcept;
[[nodiscard]] std::string utf8_from_latin1(std::string_view text);

/// Without what of `around` is at its ends: blanks and quotes, as about a field of a CSV file.
[[nodiscard]] std::string_view trimmed(std::string_view field,
                                       std::string_view around = " \t\r\"") noexcept;

/// Names of columns, whatever their case.
[[nodiscard]] bool same_name(std::string_view a, std::string_view b) noexcept;

/// True if all of the text is one number that the type holds, without sign '+' or spaces.
template <typename Number>
[[nodiscard]] bool read_number(std::string_view text, Number& out) noexcept {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    return error == std::errc() && end == text.data() + text.size();
}

/// The whole file, at most `limit` bytes. Throws std::runtime_error with the cause, without the
/// path: the caller names it in its own error.
[[nodiscard]] std::string read_whole_file(const std::string& path, std::size_t limit);

}  // namespace vibrig::proto
