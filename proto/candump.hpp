#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "proto/line_reader.hpp"

namespace vibrig::proto {

/// One frame as `candump -l` logs it and `canplayer` plays it.
struct LoggedFrame {
    std::int64_t time_ns = 0;  ///< since the log's epoch, in files whole microseconds
    std::string interface;
    std::uint32_t id = 0;  ///< without flags
    bool extended = false;
    bool remote = false;  ///< classic only; then size is the length asked for
    bool error = false;   ///< error frame: id holds the error class (linux/can/error.h)
    bool fd = false;
    std::uint8_t fd_flags = 0;  ///< 1: bit-rate switch, 2: error state indicator
    std::uint8_t size = 0;      ///< bytes; FD: 0 to 8, 12, 16, 20, 24, 32, 48 or 64
    std::array<std::uint8_t, 64> data{};
    friend bool operator==(const LoggedFrame&, const LoggedFrame&) = default;
};

/// A log that cannot be read: "file:line: found X, expected Y".
class CandumpError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// "(sec.usec) interface ID#DATA" or "ID##FLAGS DATA", without the line's end. Throws CandumpError
/// for a frame that no bus carries.
[[nodiscard]] std::string candump_line(const LoggedFrame& frame);
/// Reads one such line; a direction (R or T) after the frame is ignored. Throws CandumpError,
/// without file and line.
[[nodiscard]] LoggedFrame parse_candump_line(std::string_view text);

/// Reads a log frame by frame in bounded memory. Empty lines and comments (#), which
/// canplayer skips as well, are passed over.
class CandumpReader {
  public:
    explicit CandumpReader(std::string path);
    /// The next frame, or nothing at the end. Throws CandumpError.
    [[nodiscard]] std::optional<LoggedFrame> next();

  private:
    std::string path_;
    std::optional<LineReader> lines_;
};

}  // namespace vibrig::proto
