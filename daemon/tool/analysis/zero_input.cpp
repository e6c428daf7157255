#include "daemon/tool/analysis/zero_command.hpp"

#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/results/text_line.hpp"
#include "proto/text.hpp"

namespace vibrig::tool::zero_command {

namespace {

// No unit has more, in whatever time a file is counted from: beyond them are other columns, and
// numbers whose products overflow.
constexpr double kLargestTime_s = 1e12, kLongestStep_s = 86400;
constexpr double kLargestTurn_arcsec = 1e8, kLargestVelocity_mps = 1e5, kLargestAzimuth_deg = 1e9;

/// File and line of a row of numbers; of a compressed file the number of the row. Columns do not
/// keep their lines: a file is read again for the sake of the message.
std::string place_of_row(const std::string& file, std::size_t row) {
    std::ifstream in(file, std::ios::binary);
    bool header = false;
    std::string text;
    for (std::size_t line = 1, rows = 0; std::getline(in, text); ++line) {
        std::string_view content = text;
        if (line == 1 && content.substr(0, 2) == "\x1f\x8b") break;
        if (line == 1) content = proto::without_byte_order_mark(content);
        content = proto::trimmed(content);
        if (content.empty() || content.front() == '#' || content.front() == '%') continue;
        if (!std::exchange(header, true)) continue;
        if (rows++ == row) return file + ":" + std::to_string(line);
    }
    return file + printed(": row %zu of numbers", row + 1);
}

[[noreturn]] void refuse_row(const std::string& file, std::size_t row, const std::string& column,
                             const std::string& found, const std::string& expected) {
    throw std::runtime_error(place_of_row(file, row) + ": column " + column + ": found " + found +
                             ", expected " + expected);
}

void check_times(const std::string& file, const std::vector<double>& times) {
    for (std::size_t k = 0; k < times.size(); ++k) {
        const double time = times[k];
        const std::string found =
            std::isnan(time) ? std::string("no number") : printed("%.12g", time);
        if (!(std::abs(time) <= kLargestTime_s))
            refuse_row(file, k, "time_s", found,
                       printed("s from %g to %g", -kLargestTime_s, kLargestTime_s));
        if (k > 0 && !(time > times[k - 1]))
            refuse_row(file, k, "time_s", found,
                       printed("more than %.12g of the row before", times[k - 1]));
        if (k > 0 && time - times[k - 1] > kLongestStep_s)
            refuse_row(file, k, "time_s", found,
                       printed("at most %g s after %.12g of the row before", kLongestStep_s,
                               times[k - 1]));
    }
}

void check_values(const std::string& file, const ColumnFile& column, double largest) {
    for (std::size_t k = 0; k < column.values.size(); ++k) {
        if (std::abs(column.values[k]) > largest)
            refuse_row(file, k, column.column, printed("%.6g", column.values[k]),
                       printed("a number from %g to %g", -largest, largest));
    }
}

}  // namespace

void check_increments(const std::string& file, const std::array<ColumnFile, 6>& columns,
                      const ColumnFile& azimuth) {
    if (columns[0].times.empty())
        throw std::runtime_error(file +
                                 ": found no row after the header, expected increments, one a row");
    check_times(file, columns[0].times);
    for (std::size_t i = 0; i < columns.size(); ++i)
        check_values(file, columns[i], i < 3 ? kLargestTurn_arcsec : kLargestVelocity_mps);
    check_values(file, azimuth, kLargestAzimuth_deg);
}

}  // namespace vibrig::tool::zero_command
