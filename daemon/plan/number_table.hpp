#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::plan {

/// Numbers of a CSV file with a header row.
struct NumberTable {
    std::vector<std::string> names;
    std::vector<std::vector<double>> rows;  ///< NaN in columns that were not wanted
    std::vector<std::size_t> lines;         ///< of the rows, from 1

    [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;
};

/// The whole file; at most 16 MiB. Throws PlanFileError.
[[nodiscard]] std::string content_of(const std::string& path);
/// `text` is the content of `path`. Columns that are `wanted` hold a finite number in each row;
/// whether they exist is the caller's to ask, others are ignored. Throws PlanFileError with file,
/// line and column.
[[nodiscard]] NumberTable read_table(const std::string& text, const std::string& path,
                                     const std::vector<std::string_view>& wanted);

/// Throws PlanFileError "place: found X, expected Y".
[[noreturn]] void refuse(const std::string& place, const std::string& found,
                         const std::string& expected);

}  // namespace vibrig::plan
