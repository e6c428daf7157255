#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::plan {

/// Which columns of a CSV file are looked at, whatever the case of their names; none of them has to
/// be there, others are ignored, unless they look like one that is not there, misspelt.
struct TableForm {
    std::vector<std::string_view> numbers;          ///< a finite one in each row
    std::vector<std::string_view> maybe_numbers{};  ///< the same, or nothing
    std::vector<std::string_view> words{};          ///< any, or nothing
};

/// Numbers of a CSV file with a header row.
struct NumberTable {
    std::vector<std::string> names;
    std::vector<std::vector<double>> rows;        ///< NaN in columns that are no numbers
    std::vector<std::vector<std::string>> words;  ///< of the rows; empty in columns that are none
    std::vector<std::size_t> lines;               ///< of the rows, from 1
    std::string warning{};  ///< the last row has no end of line; told on standard error already

    [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;
};

/// The whole file; at most 16 MiB. Throws PlanFileError.
[[nodiscard]] std::string content_of(const std::string& path);
/// `text` is the content of `path`. Throws PlanFileError with file, line and column.
[[nodiscard]] NumberTable read_table(const std::string& text, const std::string& path,
                                     const TableForm& form);

/// Throws PlanFileError where one of `keys` is not among `known` and looks like one of them that is
/// not there. What resembles none, a remark of somebody's, may stand there.
void refuse_misspelt(const std::vector<std::string_view>& keys,
                     const std::vector<std::string_view>& known,
                     const std::function<std::string(const std::string&)>& place_of);

/// Throws PlanFileError "place: found X, expected Y".
[[noreturn]] void refuse(const std::string& place, const std::string& found,
                         const std::string& expected);

}  // namespace vibrig::plan
