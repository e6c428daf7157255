#pragma once

#include <string>

#include "proto/printed.hpp"

namespace vibrig::tool {

using proto::printed;

/// The same, with the end of a line.
template <class... Values>
[[nodiscard]] std::string line(const char* format, Values... values) {
    return printed(format, values...) + "\n";
}

}  // namespace vibrig::tool
