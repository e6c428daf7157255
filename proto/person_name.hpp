#pragma once

#include <string>
#include <string_view>

namespace vibrig::proto {

/// A person's name as it is read aloud, to compare two: "Ada  Lovelace (uid 0)" is "ada lovelace".
/// Every space of Unicode is one, what has no width is nothing; empty: nobody is named.
[[nodiscard]] std::string plain_name(std::string_view name);

/// Whether two names, as commands carry them, are one person's: what the person says, whatever its
/// case and spaces.
[[nodiscard]] bool same_person(std::string_view a, std::string_view b);

}  // namespace vibrig::proto
