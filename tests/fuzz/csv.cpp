// A recording as CSV, and its first lines as ones of candump.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "proto/candump.hpp"
#include "proto/recording_csv.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig::proto;
    static const int file = ::memfd_create("recording", MFD_CLOEXEC);
    static const std::string path = "/proc/self/fd/" + std::to_string(file);
    if (::ftruncate(file, 0) != 0 || ::pwrite(file, data, size, 0) != static_cast<ssize_t>(size))
        std::abort();
    try {
        RecordingReader reader(path);
        for (RecordingRow row; reader.next(row);) {
        }
    } catch (const RecordingError&) {
    }
    std::string_view text(reinterpret_cast<const char*>(data), size);
    for (int line_number = 0; line_number < 8 && !text.empty(); ++line_number) {
        const std::string_view line = text.substr(0, text.find('\n'));
        try {
            // What is read is written as it was meant.
            const LoggedFrame frame = parse_candump_line(line);
            if (candump_line(parse_candump_line(candump_line(frame))) != candump_line(frame))
                std::abort();
        } catch (const CandumpError&) {
        }
        text.remove_prefix(std::min(text.size(), line.size() + 1));
    }
    return 0;
}
