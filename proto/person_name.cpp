#include "proto/person_name.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "proto/utf8.hpp"

namespace vibrig::proto {

namespace {

using Range = std::pair<char32_t, char32_t>;

// Unicode's white space, and its characters that show nothing (general category Cf, and fillers).
constexpr std::array<Range, 10> kSpaces{{{0x09, 0x0d},
                                         {0x20, 0x20},
                                         {0x85, 0x85},
                                         {0xa0, 0xa0},
                                         {0x1680, 0x1680},
                                         {0x2000, 0x200a},
                                         {0x2028, 0x2029},
                                         {0x202f, 0x202f},
                                         {0x205f, 0x205f},
                                         {0x3000, 0x3000}}};
constexpr std::array<Range, 13> kNothing{{{0x00ad, 0x00ad},
                                          {0x034f, 0x034f},
                                          {0x061c, 0x061c},
                                          {0x115f, 0x1160},
                                          {0x17b4, 0x17b5},
                                          {0x180b, 0x180f},
                                          {0x200b, 0x200f},
                                          {0x202a, 0x202e},
                                          {0x2060, 0x206f},
                                          {0x3164, 0x3164},
                                          {0xfe00, 0xfe0f},
                                          {0xfeff, 0xfeff},
                                          {0xe0000, 0xe0fff}}};

template <typename Ranges>
bool is_in(const Ranges& ranges, char32_t code) {
    return std::ranges::any_of(ranges,
                               [&](const Range& r) { return code >= r.first && code <= r.second; });
}

}  // namespace

std::string plain_name(std::string_view name) {
    name = name.substr(0, name.find(" ("));
    std::string plain;
    bool space = false;
    while (!name.empty()) {
        const auto [length, code] = first_character(name);
        const std::string_view bytes = name.substr(0, std::max<std::size_t>(length, 1));
        name.remove_prefix(bytes.size());
        if (length != 0 && is_in(kSpaces, code)) {
            space = !plain.empty();
        } else if (length == 0 || !is_in(kNothing, code)) {
            if (std::exchange(space, false)) plain += ' ';
            const char c = bytes.front();
            plain += c >= 'A' && c <= 'Z' ? std::string(1, static_cast<char>(c - 'A' + 'a'))
                                          : std::string(bytes);
        }
    }
    return plain;
}

bool same_person(std::string_view a, std::string_view b) { return plain_name(a) == plain_name(b); }

}  // namespace vibrig::proto
