#include "daemon/plot/xml_text.hpp"

#include "proto/text.hpp"

namespace vibrig::tool::plot {

std::string xml_text(const std::string& text) {
    std::string out;
    for (const char c : proto::mend_utf8(text)) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            case '\n':
                out += c;
                break;
            default:
                out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
        }
    }
    return out;
}

}  // namespace vibrig::tool::plot
