#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::tool {

/// A finite number, or NaN for a missing one: an empty field, "nan", "NaN", "NAN", "NA" and JSON's
/// "null". False for anything else.
[[nodiscard]] bool read_sample(std::string_view field, double& value);
/// A first line without the mark of its byte order.
[[nodiscard]] std::string_view without_mark(std::string_view text);
[[nodiscard]] bool is_comment(std::string_view content);
/// No sample, and not one that is broken either: it does not start like a number.
[[nodiscard]] bool is_name(std::string_view word);

/// A column of numbers from a text or CSV file, plain or gzip. A blank row between the numbers of a
/// file with one column is a missing value (NaN), as what read_sample() takes for one; other blank
/// rows are skipped.
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
