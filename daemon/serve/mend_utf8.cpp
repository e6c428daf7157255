// What comes from files, buses and persons may be no UTF-8; messages have to be.
#include "daemon/serve/status_message.hpp"

namespace vibrig::serve {

std::string mend_utf8(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t i = 0; i < text.size();) {
        const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[i + k]); };
        const unsigned lead = byte(0);
        std::size_t length = 0;
        if (lead < 0x80)
            length = 1;
        else if (lead >= 0xC2 && lead <= 0xDF)
            length = 2;
        else if (lead >= 0xE0 && lead <= 0xEF)
            length = 3;
        else if (lead >= 0xF0 && lead <= 0xF4)
            length = 4;
        bool good = length > 0 && i + length <= text.size();
        for (std::size_t k = 1; good && k < length; ++k) good = (byte(k) & 0xC0) == 0x80;
        // Overlong forms, surrogates, and what lies beyond U+10FFFF (RFC 3629, section 4).
        if (good && lead == 0xE0) good = byte(1) >= 0xA0;
        if (good && lead == 0xED) good = byte(1) <= 0x9F;
        if (good && lead == 0xF0) good = byte(1) >= 0x90;
        if (good && lead == 0xF4) good = byte(1) <= 0x8F;
        if (good) {
            out.append(text.substr(i, length));
            i += length;
        } else {
            out.push_back('?');
            ++i;
        }
    }
    return out;
}

}  // namespace vibrig::serve
