#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/can/can_port.hpp"

namespace vibrig::record {

/// A frame that the daemon received, or the mark of its start, as a raw log has it.
struct RawFrame {
    drivers::ReceivedFrame frame;
    bool start = false;    ///< no frame: the daemon was started again here
    std::size_t log = 0;   ///< which of the logs
    std::size_t line = 0;  ///< from 1
};

/// Frames of raw logs in the order of the logs. Other threads decompress and read ahead, in memory
/// that does not grow with the logs. What the daemon sent and error frames are passed over, as is a
/// line without an end: it was cut off with its writer. Throws std::runtime_error.
class RawFrames {
  public:
    RawFrames(std::vector<std::string> logs, std::int64_t utc_offset_ns);
    ~RawFrames();
    RawFrames(const RawFrames&) = delete;
    RawFrames& operator=(const RawFrames&) = delete;

    /// Valid until the next call; none: the end.
    [[nodiscard]] const RawFrame* next();
    [[nodiscard]] const std::string& path_of(const RawFrame& frame) const {
        return logs_[frame.log];
    }

  private:
    struct Ahead;
    std::vector<std::string> logs_;
    std::unique_ptr<Ahead> ahead_;
};

}  // namespace vibrig::record
