#pragma once

#include <array>
#include <string>

#include "daemon/allan/column_file.hpp"

namespace vibrig::tool::zero_command {

/// Six columns of increments, each with its times, and the azimuth, which may be empty. Throws
/// std::runtime_error with file, line, column and value for a time that is missing or does not
/// grow, and for numbers that no unit has; a missing increment or azimuth is a gap.
void check_increments(const std::string& file, const std::array<ColumnFile, 6>& columns,
                      const ColumnFile& azimuth);

}  // namespace vibrig::tool::zero_command
