#include "proto/text.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <utility>

#include "proto/utf8.hpp"

namespace vibrig::proto {

namespace {

/// Bytes of the UTF-8 sequence at the text's beginning; 0 if there is none.
/// Overlong forms, surrogates and code points above U+10FFFF are none (RFC 3629).
std::size_t sequence_length(std::string_view text) noexcept {
    const auto byte = [&](std::size_t i) {
        return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
    };
    const unsigned lead = byte(0);
    if (lead < 0x80) return 1;
    const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
    if (lead < 0xc2 || lead > 0xf4) return 0;
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xc0U) != 0x80) return 0;
    }
    if ((lead == 0xe0 && byte(1) < 0xa0) || (lead == 0xed && byte(1) > 0x9f)) return 0;
    if ((lead == 0xf0 && byte(1) < 0x90) || (lead == 0xf4 && byte(1) > 0x8f)) return 0;
    return length;
}

/// One character as it is, or its escape; a byte that is none, its escape.
std::string shown(std::string_view bytes) {
    constexpr std::array<std::pair<char, const char*>, 3> kNamed{
        {{'\n', "\\n"}, {'\r', "\\r"}, {'\t', "\\t"}}};
    for (const auto& [byte, name] : kNamed)
        if (bytes.front() == byte) return name;
    const auto [length, character] = first_character(bytes);
    const bool foreign = length == 0;
    const auto code = static_cast<unsigned>(character);
    const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0);
    const bool turns = code == 0x200E || code == 0x200F || (code >= 0x2028 && code <= 0x202E) ||
                       (code >= 0x2066 && code <= 0x2069);
    if (!control && !turns && !foreign) return std::string(bytes);
    std::array<char, 8> out{};
    std::snprintf(out.data(), out.size(), bytes.size() == 1 ? "\\x%02x" : "\\u%04x", code);
    return out.data();
}

}  // namespace

Utf8Character first_character(std::string_view text) noexcept {
    const std::size_t length = sequence_length(text);
    char32_t code = static_cast<unsigned char>(text.front());
    if (length > 1) code &= 0xffU >> (length + 1);
    for (std::size_t i = 1; i < length; ++i)
        code = code << 6U | (static_cast<unsigned char>(text[i]) & 0x3fU);
    return {length, code};
}

std::string printable(std::string_view text, std::size_t longest) {
    std::string out;
    while (!text.empty()) {
        const std::size_t length = std::max<std::size_t>(sequence_length(text), 1);
        const std::string next = shown(text.substr(0, length));
        if (out.size() + next.size() > longest) return out + "...";
        out += next;
        text.remove_prefix(length);
    }
    return out;
}

std::string mend_utf8(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    while (!text.empty()) {
        const std::size_t length = sequence_length(text);
        out += length == 0 ? std::string_view("?") : text.substr(0, length);
        text.remove_prefix(std::max<std::size_t>(length, 1));
    }
    return out;
}

std::string_view without_byte_order_mark(std::string_view text) noexcept {
    return text.starts_with("\xef\xbb\xbf") ? text.substr(3) : text;
}

bool is_utf8(std::string_view text) noexcept {
    while (!text.empty()) {
        const std::size_t length = sequence_length(text);
        if (length == 0) return false;
        text.remove_prefix(length);
    }
    return true;
}

std::string utf8_from_latin1(std::string_view text) {
    std::string out;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte < 0x80) {
            out += c;
        } else {
            out += static_cast<char>(0xc0U | (byte >> 6));
            out += static_cast<char>(0x80U | (byte & 0x3fU));
        }
    }
    return out;
}

std::string_view trimmed(std::string_view field, std::string_view around) noexcept {
    const std::size_t first = field.find_first_not_of(around);
    if (first == std::string_view::npos) return {};
    return field.substr(first, field.find_last_not_of(around) - first + 1);
}

std::string read_whole_file(const std::string& path, std::size_t limit) {
    const auto close = [](std::FILE* file) { (void)std::fclose(file); };
    const std::unique_ptr<std::FILE, decltype(close)> file(std::fopen(path.c_str(), "rb"), close);
    if (!file) throw std::runtime_error(std::string("cannot be opened: ") + std::strerror(errno));
    constexpr std::size_t kChunk = std::size_t{1} << 20;
    std::string text;
    for (;;) {
        const std::size_t filled = text.size();
        text.resize(filled + kChunk);
        const std::size_t got = std::fread(text.data() + filled, 1, kChunk, file.get());
        text.resize(filled + got);
        if (text.size() > limit) {
            throw std::runtime_error("found more than " + std::to_string(limit) +
                                     " bytes, expected a smaller file");
        }
        if (got < kChunk) break;
    }
    if (std::ferror(file.get()) != 0) {
        throw std::runtime_error(std::string("cannot be read: ") + std::strerror(errno));
    }
    return text;
}

bool same_name(std::string_view a, std::string_view b) noexcept {
    const auto lower = [](char c) {
        return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    };
    return std::ranges::equal(a, b, {}, lower, lower);
}

}  // namespace vibrig::proto
