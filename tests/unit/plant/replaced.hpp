#pragma once

#include <gtest/gtest.h>

#include <string>

namespace vibrig::plant {

/// The first `from` of a text by `to`; a test fails that has none.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

}  // namespace vibrig::plant
