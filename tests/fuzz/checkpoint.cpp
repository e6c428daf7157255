// A dwell of the journal whose checksum is right, whatever else it holds: decoded, or refused with
// a reason.
#include <zlib.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "daemon/journal/checkpoint.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig::journal;
    constexpr std::uint64_t kConfiguration = 0x0123456789abcdef;
    static const std::string head =
        encode({}, kConfiguration).substr(0, 20);  // magic, version, configuration
    DwellCheckpoint dwell;
    std::string bytes(reinterpret_cast<const char*>(data), size);
    static_cast<void>(decode(bytes, kConfiguration, dwell));
    // Random bytes hardly ever have a checksum: this gives them one, and the beginning of a
    // checkpoint.
    bytes = head + bytes;
    const auto sum = static_cast<std::uint32_t>(
        ::crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
    bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
    dwell = {};
    if (decode(bytes, kConfiguration, dwell).empty()) {
        // What is decoded comes back, but for a flag's byte and the layout of an older version.
        DwellCheckpoint again;
        if (!decode(encode(dwell, kConfiguration), kConfiguration, again).empty()) std::abort();
        if (again.measurements.size() != dwell.measurements.size()) std::abort();
    }
    return 0;
}
