#pragma once

#include <string>

namespace vibrig::tool {

/// In words, the first thing in which a recorded result, as result_json() writes it, is not
/// `replayed`: coefficients with all that is said of them, verdict, and what else stands in it;
/// warnings, build and the unit's type left aside. What `recorded` lacks beside coefficients and
/// verdict is of an earlier version. Empty: nothing. Whatever `recorded` is, it throws nothing.
[[nodiscard]] std::string result_difference(const std::string& recorded,
                                            const std::string& replayed);

}  // namespace vibrig::tool
