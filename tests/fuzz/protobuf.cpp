// What a broker may bring, and a command as JSON: taken or refused by one clear error.
#include <google/protobuf/stubs/logging.h>

#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "daemon/fleet/edge_node.hpp"
#include "daemon/serve/status_json.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig;
    // Of names that are no UTF-8 a debug build tells every time.
    static auto* const silenced = google::protobuf::SetLogHandler(nullptr);
    static_cast<void>(silenced);
    const std::string bytes(reinterpret_cast<const char*>(data), size);
    static_cast<void>(fleet::EdgeNode::asks_for_birth(bytes));
    try {
        static_cast<void>(serve::parse_command(bytes));
    } catch (const std::invalid_argument& error) {
        if (*error.what() == '\0') std::abort();
    }
    return 0;
}
