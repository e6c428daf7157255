#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace vibrig::estimator::commissioning {

/// printf for sentences of up to 299 characters.
template <class... Values>
[[nodiscard]] std::string words(const char* pattern, Values... values) {
    std::array<char, 300> text{};
    std::snprintf(text.data(), text.size(), pattern, values...);
    return text.data();
}

}  // namespace vibrig::estimator::commissioning
