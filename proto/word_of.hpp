#pragma once

#include <array>
#include <cstddef>

namespace vibrig::proto {

/// The word of an enumerator that counts from 0; of none `other`.
template <typename Enum, std::size_t N>
[[nodiscard]] constexpr const char* word_of(const std::array<const char*, N>& words, Enum value,
                                            const char* other = "?") noexcept {
    const auto index = static_cast<std::size_t>(value);
    return index < N ? words[index] : other;
}

}  // namespace vibrig::proto
