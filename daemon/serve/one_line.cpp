#include "daemon/serve/one_line.hpp"

#include <array>
#include <cstdio>

#include "daemon/serve/status_message.hpp"

namespace vibrig::serve {
namespace {

/// The escape of the character whose bytes these are; empty: it is harmless.
std::string escape(std::string_view bytes) {
    unsigned code = static_cast<unsigned char>(bytes[0]);
    if (bytes.size() == 2) code = (code & 0x1F) << 6;
    if (bytes.size() == 3)
        code = (code & 0x0F) << 12 | (static_cast<unsigned char>(bytes[1]) & 0x3FU) << 6;
    if (bytes.size() > 3) return {};
    if (bytes.size() > 1) code |= static_cast<unsigned char>(bytes.back()) & 0x3FU;
    if (code == '\n') return "\\n";
    if (code == '\r') return "\\r";
    if (code == '\t') return "\\t";
    const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0);
    const bool turns = code == 0x200E || code == 0x200F || (code >= 0x2028 && code <= 0x202E) ||
                       (code >= 0x2066 && code <= 0x2069);
    if (!control && !turns) return {};
    std::array<char, 8> out{};
    std::snprintf(out.data(), out.size(), code < 0x80 ? "\\x%02x" : "\\u%04x", code);
    return out.data();
}

}  // namespace

std::string one_line(std::string_view text, std::size_t longest) {
    const std::string whole = mend_utf8(text);
    std::string out;
    for (std::size_t i = 0; i < whole.size();) {
        const auto lead = static_cast<unsigned char>(whole[i]);
        const std::size_t length = lead < 0x80 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
        std::string next = escape(std::string_view(whole).substr(i, length));
        if (next.empty()) next = whole.substr(i, length);
        if (out.size() + next.size() > longest) return out + "...";
        out += next;
        i += length;
    }
    return out;
}

}  // namespace vibrig::serve
