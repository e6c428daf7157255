// A configuration: taken and printed as what is in force, which is taken again, or one clear error.
#include <cstdint>
#include <string>

#include "daemon/configuration/configuration.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig::configuration;
    const std::string text(reinterpret_cast<const char*>(data), size);
    try {
        static_cast<void>(format_effective(parse(text, "fuzz.toml", true)));
    } catch (const ConfigurationError&) {
    }
    return 0;
}
