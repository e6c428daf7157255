#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace vibrig::proto {

/// Whether an enumerator has that value: the compiler writes others as a cast.
template <auto kValue>
[[nodiscard]] constexpr bool is_enumerator() noexcept {
    constexpr std::string_view kPretty = __PRETTY_FUNCTION__;
    return kPretty[kPretty.find("kValue = ") + 9] != '(';
}

/// The word of an enumerator that counts from 0; of none `other`. Compiles only with a word for
/// each enumerator.
template <typename Enum, std::size_t N>
[[nodiscard]] constexpr const char* word_of(const std::array<const char*, N>& words, Enum value,
                                            const char* other = "?") noexcept {
    static_assert(
        is_enumerator<static_cast<Enum>(N - 1)>() && !is_enumerator<static_cast<Enum>(N)>(),
        "a word for each enumerator, no more");
    const auto index = static_cast<std::size_t>(value);
    return index < N ? words[index] : other;
}

}  // namespace vibrig::proto
