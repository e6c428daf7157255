#pragma once

#include <string>

#include "daemon/log/log_queue.hpp"

namespace vibrig::log {

/// Makes the queue the way of everything that is logged: UTC, level, words; with colours for a
/// terminal unless NO_COLOR is set. The queue must be there until nobody logs any more.
void log_through(LogQueue& queue, const std::string& level, bool colours);

/// Opens, or makes, a file to append lines to; throws std::system_error that names it. The caller
/// closes the descriptor.
[[nodiscard]] int open_log_file(const std::string& path);

/// Whether colours can be seen there.
[[nodiscard]] bool shows_colours(int descriptor);

}  // namespace vibrig::log
