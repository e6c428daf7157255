#include "daemon/tool/colour.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace vibrig::tool::colour {

namespace {
std::string painted(const char* code, const std::string& text) {
    return wanted() ? "\x1b[" + std::string(code) + 'm' + text + "\x1b[0m" : text;
}
}  // namespace

bool wanted() {
    static const bool kWanted = [] {
        const char* const no = std::getenv("NO_COLOR");
        const char* const terminal = std::getenv("TERM");
        return isatty(STDOUT_FILENO) != 0 && (no == nullptr || *no == '\0') &&
               (terminal == nullptr || std::string_view(terminal) != "dumb");
    }();
    return kWanted;
}

std::string good(const std::string& text) { return painted("32", text); }
std::string warning(const std::string& text) { return painted("33", text); }
std::string bad(const std::string& text) { return painted("1;31", text); }
std::string strong(const std::string& text) { return painted("1", text); }

}  // namespace vibrig::tool::colour
