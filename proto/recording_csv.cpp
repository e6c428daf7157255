#include "proto/recording_csv.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "proto/line_reader.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

namespace {

struct Column {
    std::string_view name;
    double limit = 0;  ///< absolute value; beyond it the column holds something else
    const char* unit = "";
};

constexpr std::array<Column, 9> kColumns = {{{"time_s", 1e12, "s"},
                                             {"run", 0, ""},
                                             {"position", 0, ""},
                                             {"alpha_deg", 1e4, "deg"},
                                             {"beta_deg", 1e4, "deg"},
                                             {"gamma_deg", 1e4, "deg"},
                                             {"ax_g", 1e3, "g"},
                                             {"ay_g", 1e3, "g"},
                                             {"az_g", 1e3, "g"}}};
constexpr std::size_t kTime = 0;
constexpr std::size_t kRun = 1;
constexpr std::size_t kPosition = 2;
constexpr std::size_t kAngles = 3;
constexpr std::size_t kForces = 6;
constexpr std::size_t kNone = kColumns.size();

std::string locate(const std::string& file, std::size_t line, const std::string& column,
                   const std::string& what) {
    std::string text = file + ":";
    if (line > 0) text += std::to_string(line) + ":";
    if (!column.empty()) text += " column " + column + ":";
    return text + " " + what;
}

std::string quoted(std::string_view text) {
    return text.empty() ? "nothing" : "'" + printable(text) + "'";
}

std::string_view trim(std::string_view text) noexcept {
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
    while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
    return text;
}

std::string text_of(double value) {
    std::array<char, 32> text{};
    const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
    return {text.data(), error == std::errc() ? end : text.data()};
}

class RecordingReader {
  public:
    explicit RecordingReader(const std::string& path) try : path_(path), lines_(path) {
    } catch (const std::runtime_error& error) {
        throw RecordingError(path, 0, "", error.what());
    }

    std::vector<RecordingRow> run() {
        read_header();
        std::vector<RecordingRow> rows;
        while (const auto line = next_line()) {
            if (!trim(*line).empty()) rows.push_back(row(*line));
        }
        if (rows.empty()) {
            throw RecordingError(path_, 0, "", "found no row after the header, expected samples");
        }
        return rows;
    }

  private:
    [[noreturn]] void fail(std::string_view column, const std::string& what) const {
        throw RecordingError(path_, lines_.line(), std::string(column), what);
    }

    std::optional<std::string_view> next_line() {
        try {
            return lines_.next();
        } catch (const std::runtime_error& error) {
            fail("", error.what());
        }
    }

    /// Splits at commas outside quotes; a field loses its quotes and the blanks around it.
    void split(std::string_view line) {
        fields_.clear();
        for (bool more = true; more;) {
            std::string_view rest = trim(line);
            std::string_view field;
            if (rest.starts_with('"')) {
                const std::size_t end = closing_quote(rest);
                field = rest.substr(1, end - 1);
                rest = trim(rest.substr(end + 1));
                if (!rest.empty() && rest.front() != ',') {
                    fail("", "found " + quoted(rest) + " after a closing quote, expected ','");
                }
                more = !rest.empty();
            } else {
                const std::size_t end = std::min(rest.find(','), rest.size());
                field = rest.substr(0, end);
                rest = rest.substr(end);
                more = !rest.empty();
            }
            fields_.push_back(trim(field));
            line = more ? rest.substr(1) : rest;
        }
    }

    std::size_t closing_quote(std::string_view text) const {
        std::size_t end = text.find('"', 1);
        while (end != std::string_view::npos && text.substr(end, 2) == "\"\"") {
            end = text.find('"', end + 2);
        }
        if (end == std::string_view::npos) {
            fail("", "found an opening quote only, expected a closing one on the same line");
        }
        return end;
    }

    void read_header() {
        const auto line = next_line();
        if (!line) {
            throw RecordingError(path_, 0, "", "found an empty file, expected a header row");
        }
        split(without_byte_order_mark(*line));
        std::array<bool, kColumns.size()> seen{};
        for (const std::string_view name : fields_) {
            const auto found = std::find_if(kColumns.begin(), kColumns.end(),
                                            [&](const Column& c) { return c.name == name; });
            const auto index = static_cast<std::size_t>(found - kColumns.begin());
            if (index != kNone && std::exchange(seen.at(index), true)) {
                fail(name, "found twice in the header, expected once");
            }
            roles_.push_back(index);
        }
        std::string missing;
        for (std::size_t i = 0; i < kColumns.size(); ++i) {
            if (!seen.at(i))
                missing += (missing.empty() ? "" : ", ") + std::string(kColumns.at(i).name);
        }
        if (!missing.empty()) {
            fail("", "found the header " + quoted(trim(without_byte_order_mark(*line))) +
                         ", expected also the column(s) " + missing);
        }
    }

    RecordingRow row(std::string_view line) {
        split(line);
        const bool trailing_comma = fields_.size() == roles_.size() + 1 && fields_.back().empty();
        if (fields_.size() != roles_.size() && !trailing_comma) {
            fail("", "found " + std::to_string(fields_.size()) + " fields, expected " +
                         std::to_string(roles_.size()) + " as in the header");
        }
        RecordingRow row;
        row.line = lines_.line();
        std::string_view time_text;
        for (std::size_t i = 0; i < roles_.size(); ++i) {
            const std::string_view field = fields_[i];
            switch (const std::size_t role = roles_[i]) {
                case kNone:
                    break;
                case kTime:
                    row.time_s = real(role, field);
                    time_text = field;
                    break;
                case kRun:
                    row.run = count(role, field);
                    break;
                case kPosition:
                    row.position = count(role, field);
                    break;
                default:
                    if (role < kForces) {
                        row.angle_deg.at(role - kAngles) = real(role, field);
                    } else {
                        row.force_g.at(role - kForces) = real(role, field);
                    }
            }
        }
        check_time(row, time_text);
        return row;
    }

    double real(std::size_t role, std::string_view field) const {
        const Column& column = kColumns.at(role);
        double value = 0;
        std::string_view digits = field;
        if (digits.starts_with('+') && !digits.starts_with("+-")) digits.remove_prefix(1);
        if (!read_number(digits, value) || !std::isfinite(value)) {
            fail(column.name, "found " + quoted(field) + ", expected a finite number");
        }
        if (std::abs(value) > column.limit) {
            fail(column.name, "found " + quoted(field) + ", expected at most " +
                                  text_of(column.limit) + " " + column.unit + " either way");
        }
        return value;
    }

    int count(std::size_t role, std::string_view field) const {
        int value = 0;
        if (!read_number(field, value)) {
            // Spreadsheets and pandas write whole numbers as "3.0".
            double number = 0;
            const bool whole = read_number(field, number) && number == std::floor(number) &&
                               number <= std::numeric_limits<int>::max() && number >= 1;
            value = whole ? static_cast<int>(number) : 0;
        }
        if (value < 1) {
            fail(kColumns.at(role).name,
                 "found " + quoted(field) + ", expected a whole number from 1");
        }
        return value;
    }

    void check_time(const RecordingRow& row, std::string_view field) {
        const std::pair<int, int> pair(row.run, row.position);
        if (last_time_ == nullptr || pair != dwell_) {
            const auto [entry, is_new] = last_times_.emplace(pair, row.time_s);
            last_time_ = &entry->second;
            dwell_ = pair;
            if (is_new) return;
        }
        if (!(row.time_s > *last_time_)) {
            fail(kColumns.at(kTime).name,
                 "found " + quoted(field) + ", expected more than " + text_of(*last_time_) +
                     ", the time before it in run " + std::to_string(row.run) + ", position " +
                     std::to_string(row.position));
        }
        *last_time_ = row.time_s;
    }

    const std::string& path_;
    LineReader lines_;
    std::vector<std::string_view> fields_;
    std::vector<std::size_t> roles_;  ///< index into kColumns by field, kNone: ignored
    std::map<std::pair<int, int>, double> last_times_;
    std::pair<int, int> dwell_;
    double* last_time_ = nullptr;  ///< of the dwell in force
};

}  // namespace

RecordingError::RecordingError(const std::string& file, std::size_t line, const std::string& column,
                               const std::string& what)
    : std::runtime_error(locate(file, line, column, what)), line_(line), column_(column) {}

std::vector<RecordingRow> read_recording(const std::string& path) {
    return RecordingReader(path).run();
}

}  // namespace vibrig::proto
