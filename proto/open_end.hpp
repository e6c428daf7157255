#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace vibrig::proto {

/// The last line of a table has no end: the file may have been cut, even within its last number,
/// which is then another one. Programs end every line, editors need not: so it is told, on standard
/// error, once for each place, and returned for whoever has a list of warnings. `place`:
/// "file:line"; `field`: the last one.
std::string tell_open_end(const std::string& place, std::string_view field);

/// What is wrong with such a line that is hardly anything but cut: `found` of the `expected` fields
/// are there, or nothing in the last one, where that one is `read`. Empty: nothing is wrong.
[[nodiscard]] std::string cut_fields(std::size_t found, std::size_t expected,
                                     std::string_view field, bool read);

}  // namespace vibrig::proto
