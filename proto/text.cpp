#include "proto/text.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

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

}  // namespace

std::string printable(std::string_view text, std::size_t longest) {
    std::string out;
    std::size_t i = 0;
    while (i < text.size() && i < longest) {
        const auto byte = static_cast<unsigned char>(text[i]);
        const std::size_t length = sequence_length(text.substr(i));
        // Some terminals obey U+0080 to U+009F, too.
        const bool c1 =
            length == 2 && byte == 0xc2 && static_cast<unsigned char>(text[i + 1]) < 0xa0;
        if (length == 0 || byte < 0x20 || byte == 0x7f || c1) {
            std::array<char, 8> hex{};
            std::snprintf(hex.data(), hex.size(), "\\x%02x", static_cast<unsigned>(byte));
            out += hex.data();
            ++i;
        } else {
            out += text.substr(i, length);
            i += length;
        }
    }
    return i < text.size() ? out + "..." : out;
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

std::string_view trimmed(std::string_view field) noexcept {
    constexpr std::string_view kAround = " \t\r\"";
    const std::size_t first = field.find_first_not_of(kAround);
    if (first == std::string_view::npos) return {};
    return field.substr(first, field.find_last_not_of(kAround) - first + 1);
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

}  // namespace vibrig::proto
