#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace vibrig::tool {

/// A column of numbers from a text or CSV file, plain or gzip. An empty field, "nan" and "NA" are
/// missing values (NaN), and so is a blank row between the numbers of a file with one column; other
/// blank rows are skipped.
struct ColumnFile {
    std::vector<double> values;
    std::vector<double> times;  ///< if a time column was asked for
    std::string column;         ///< name, or number as text in a file without header
    std::string warning;        ///< the last row has no end of line; told on standard error already
};

struct ColumnRequest {
    /// Name, whatever its case, or number from 1; may be empty in a file with one column.
    std::string column;
    std::string time;  ///< likewise; empty: none
};

/// "-" is standard input. `progress` gets bytes done and in all (0: unknown). Throws
/// std::runtime_error naming the file, the line, what was found and what was expected.
[[nodiscard]] ColumnFile read_columns(
    const std::string& path, const ColumnRequest& request,
    const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace vibrig::tool
