#include "daemon/configuration/rules.hpp"

#include <algorithm>
#include <climits>
#include <cstddef>
#include <string_view>

namespace vibrig::configuration {

namespace {

constexpr std::size_t kShortText = 120;
constexpr std::size_t kSocketPath = 107;    // sizeof(sockaddr_un::sun_path) - 1
constexpr std::size_t kInterfaceName = 15;  // IFNAMSIZ - 1
constexpr std::size_t kHostName = 253;      // RFC 1035
constexpr std::size_t kCampaignName = 64;

// Not the locale's idea of a letter.
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool only(std::string_view text, std::string_view also) {
    return std::all_of(text.begin(), text.end(), [also](char c) {
        return is_letter(c) || is_digit(c) || also.find(c) != std::string_view::npos;
    });
}

bool identifier(std::string_view text) {
    return !text.empty() && !is_digit(text.front()) && only(text, "_");
}

}  // namespace

std::string campaign_name_rule(const std::string& text) {
    const bool good = !text.empty() && text.size() <= kCampaignName && only(text, " ._-") &&
                      text.front() != '.' && text.front() != ' ' && text.back() != ' ';
    return good ? "" : "1 to 64 letters, digits, ' ', '.', '_' or '-', not starting with '.'";
}

std::string interface_rule(const std::string& text) {
    const bool good = !text.empty() && text.size() <= kInterfaceName && only(text, "._-") &&
                      text != "." && text != "..";
    return good ? "" : "the name of a network interface, 1 to 15 characters, such as \"can0\"";
}

std::string socket_rule(const std::string& text) {
    const bool good = text.size() > 1 && text.size() <= kSocketPath &&
                      (text.front() == '/' || text.front() == '@') &&
                      text.find('\0') == std::string::npos;
    return good ? "" : "an absolute path or \"@name\", 2 to 107 bytes";
}

std::string socket_file_rule(const std::string& text) {
    const bool good = socket_rule(text).empty() && text.front() == '/';
    return good ? "" : "an absolute path, 2 to 107 bytes: its mode says who may open it";
}

std::string socket_file_or_empty_rule(const std::string& text) {
    return text.empty() ? "" : socket_file_rule(text);
}

std::string socket_or_empty_rule(const std::string& text) {
    return text.empty() ? "" : socket_rule(text);
}

std::string endpoint_rule(const std::string& text) {
    if (text.empty()) return "";
    const std::size_t colon = text.rfind(':');
    const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
    const bool number = !port.empty() && port.size() <= 5 &&
                        std::all_of(port.begin(), port.end(), is_digit) && std::stoi(port) <= 65535;
    const bool good = number && colon > 0 && text.size() <= kHostName + 6 &&
                      only(text.substr(0, colon), ".:-_%[]");
    return good ? "" : "\"ADDRESS:PORT\" or \"\"";
}

std::string group_rule(const std::string& text) {
    constexpr std::size_t kGroupName = 32;
    const bool good = text.size() <= kGroupName && only(text, "._-$");
    return good ? "" : "the name of a group, 32 characters at most, or \"\"";
}

std::string path_rule(const std::string& text) {
    const bool good = text.size() < PATH_MAX && text.find('\0') == std::string::npos;
    return good ? "" : "a path";
}

std::string folder_rule(const std::string& text) {
    return text.empty() || !path_rule(text).empty() ? "a path, not empty" : "";
}

std::string host_rule(const std::string& text) {
    const bool good = !text.empty() && text.size() <= kHostName && only(text, ".:-_%");
    return good ? "" : "a host name or numeric address";
}

std::string host_or_empty_rule(const std::string& text) {
    return text.empty() ? "" : host_rule(text);
}

std::string line_rule(const std::string& text) {
    constexpr std::size_t kLine = 256;
    const bool good = text.size() <= kLine && std::none_of(text.begin(), text.end(), [](char c) {
                          return (c >= 0 && c < 0x20) || c == 0x7F;
                      });
    return good ? "" : "one line, 256 bytes at most";
}

std::string short_text_rule(const std::string& text) {
    for (const char c : text) {
        if (static_cast<unsigned char>(c) < 0x20) return "one line of text";
    }
    return text.size() <= kShortText ? "" : "at most 120 bytes";
}

std::string binding_rule(const std::string& text) {
    const std::size_t dot = text.find('.');
    const bool good =
        text.empty() || (dot != std::string::npos && identifier(text.substr(0, dot)) &&
                         identifier(text.substr(dot + 1)));
    return good ? "" : "\"Message.Signal\", or \"\" for not bound";
}

std::string identifier_rule(const std::string& text) {
    return identifier(text) ? "" : "a name as in the DBC file: letters, digits and '_'";
}

std::string identifier_or_empty_rule(const std::string& text) {
    return text.empty() ? "" : identifier_rule(text);
}

}  // namespace vibrig::configuration
