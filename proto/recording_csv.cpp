#include "proto/recording_csv.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "proto/edits.hpp"
#include "proto/line_reader.hpp"
#include "proto/open_end.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

namespace {

struct Column {
    std::string_view name;
    double limit = 0;  ///< absolute value; beyond it the column holds something else
    const char* unit = "";
};

constexpr std::array<Column, 13> kColumns = {{{"time_s", 1e12, "s"},
                                              {"run", 0, ""},
                                              {"position", 0, ""},
                                              {"alpha_deg", 1e4, "deg"},
                                              {"beta_deg", 1e4, "deg"},
                                              {"gamma_deg", 1e4, "deg"},
                                              {"ax_g", 1e3, "g"},
                                              {"ay_g", 1e3, "g"},
                                              {"az_g", 1e3, "g"},
                                              {"frequency_hz", 2e3, "Hz"},
                                              {"profile", 0, ""},
                                              {"level_db", 100, "dB"},
                                              {"role", 0, ""}}};
constexpr std::size_t kNeeded = 9;  ///< the others may be missing
constexpr std::size_t kFrequency = 9, kProfile = 10, kLevel = 11, kRole = 12;
constexpr std::size_t kMostProfiles = 1000;
constexpr std::size_t kTime = 0;
constexpr std::size_t kRun = 1;
constexpr std::size_t kPosition = 2;
constexpr std::size_t kAngles = 3;
constexpr std::size_t kForces = 6;
constexpr std::size_t kNone = kColumns.size();
constexpr std::string_view kSimulated = "simulated";

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

std::string_view trim(std::string_view text) noexcept { return trimmed(text, " \t"); }

constexpr std::size_t kMisspelt = 2;  ///< edits

bool misspelt_role(std::string_view word) {
    return edits(word, "verify") <= kMisspelt || edits(word, "identify") <= kMisspelt;
}

std::string text_of(double value) {
    std::array<char, 32> text{};
    const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
    return {text.data(), error == std::errc() ? end : text.data()};
}

}  // namespace

class RecordingReader::Rows {
  public:
    explicit Rows(const std::string& path) try : path_(path), lines_(path) {
        read_header();
        frequency_ = std::ranges::count(roles_, kFrequency) > 0;
        profile_ = std::ranges::count(roles_, kProfile) > 0;
    } catch (const RecordingError&) {
        throw;
    } catch (const std::runtime_error& error) {
        throw RecordingError(path, 0, "", error.what());
    }

    bool next(RecordingRow& to) {
        while (const auto line = next_line()) {
            if (trim(*line).empty()) continue;
            to = row(*line);
            return true;
        }
        if (!last_time_)
            throw RecordingError(path_, 0, "", "found no row after the header, expected samples");
        return false;
    }
    [[nodiscard]] bool simulated() const { return simulated_; }
    [[nodiscard]] bool has_frequency() const { return frequency_; }
    [[nodiscard]] bool has_profile() const { return profile_; }
    [[nodiscard]] const std::vector<std::string>& profiles() const { return profiles_; }
    [[nodiscard]] std::uint64_t bytes() const { return lines_.bytes(); }
    [[nodiscard]] const std::string& warning() const { return warning_; }

  private:
    /// Tells a dwell that is there twice: times may begin anew in each dwell, but noise does not
    /// come again. Told by a second of rows, so that a copy that was cut short is found, too.
    class CopiesSeen {
        using Bits = std::uint64_t;

      public:
        void begin(std::size_t line) {
            line_ = line;
            rows_ = 0;
        }
        /// The line where a dwell begins that has the newest samples too; 0: they are new, or too
        /// few to tell yet.
        [[nodiscard]] std::size_t add(const RecordingRow& row) {
            std::uint64_t readings = kFnvOffset;  // + 0.0: "-0" is "0"
            for (const double angle : row.angle_deg)
                mix(readings, std::bit_cast<Bits>(angle + 0.0));
            for (const double force : row.force_g) mix(readings, std::bit_cast<Bits>(force + 0.0));
            newest_[rows_ % kTold] = {row.time_s, readings};
            ++rows_;
            if (rows_ < kTold) return 0;
            // Those that a dwell begins with, and behind readings that say so themselves: whoever
            // cuts a dwell out of a record once more need not cut it at the same row.
            const Seen& first = newest_[rows_ % kTold];
            if (rows_ > kTold && first.readings % kOneIn != 0) return 0;
            std::uint64_t hash = kFnvOffset;
            std::size_t changes = 0;
            for (std::size_t k = 0, last = first.readings; k < kTold; ++k) {
                const Seen& seen = newest_[(rows_ + k) % kTold];
                // Whoever copies a dwell may have moved it in time: to the nanosecond it is one all
                // the same.
                mix(hash, std::bit_cast<Bits>(std::round((seen.time_s - first.time_s) * 1e9)));
                mix(hash, seen.readings);
                changes += std::exchange(last, seen.readings) != seen.readings ? 1U : 0U;
            }
            // Instruments too coarse for the noise show nothing by which one dwell is another.
            if (2 * changes < kTold) return 0;
            const auto [known, fresh] = dwells_.emplace(hash, line_);
            return fresh || known->second == line_ ? 0 : known->second;
        }
        [[nodiscard]] std::size_t line() const { return line_; }  ///< where the dwell began

      private:
        static constexpr std::size_t kTold = 40;  ///< 1 s of the usual 40 samples/s
        static constexpr std::size_t kOneIn = 64;
        static constexpr std::uint64_t kFnvOffset = 0xcbf29ce484222325U, kFnvPrime = 0x100000001b3U;

        struct Seen {
            double time_s = 0;
            std::uint64_t readings = 0;
        };

        static void mix(Bits& hash, Bits value) {
            hash = (hash ^ value) * kFnvPrime;
            hash ^= hash >> 32U;
        }

        std::size_t line_ = 0, rows_ = 0;
        std::array<Seen, kTold> newest_{};
        std::unordered_map<std::uint64_t, std::size_t> dwells_;  ///< where they begin, by samples
    };

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

    /// Splits at separators outside quotes; a field loses its quotes and the blanks around it.
    void split(std::string_view line) {
        fields_.clear();
        for (bool more = true; more;) {
            std::string_view rest = bare(line);
            std::string_view field;
            if (rest.starts_with('"')) {
                const std::size_t end = closing_quote(rest);
                field = rest.substr(1, end - 1);
                rest = bare(rest.substr(end + 1));
                if (!rest.empty() && rest.front() != separator_) {
                    fail("", "found " + quoted(rest) + " after a closing quote, expected '" +
                                 printable({&separator_, 1}) + "'");
                }
                more = !rest.empty();
            } else {
                const std::size_t end = std::min(rest.find(separator_), rest.size());
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

    /// Without blanks at its ends; a tab that separates is none.
    [[nodiscard]] std::string_view bare(std::string_view text) const noexcept {
        return trimmed(text, separator_ == '\t' ? " " : " \t");
    }

    /// Comma, semicolon or tab, by the header, which has one of them only.
    void find_separator(std::string_view header) {
        std::size_t kinds = 0;
        for (const char c : {',', ';', '\t'}) {
            if (header.find(c) == std::string_view::npos) continue;
            ++kinds;
            separator_ = c;
        }
        // Blanks about a comma may be tabs.
        if (kinds > 1 && header.find(',') != std::string_view::npos) separator_ = ',';
    }

    void read_header() {
        auto line = next_line();
        while (line &&
               (trim(*line).empty() || trim(without_byte_order_mark(*line)).starts_with('#')))
            line = next_line();
        if (!line) {
            throw RecordingError(path_, 0, "", "found an empty file, expected a header row");
        }
        find_separator(*line);
        split(without_byte_order_mark(*line));
        simulated_ =
            std::ranges::any_of(fields_, [](auto name) { return same_name(kSimulated, name); });
        std::array<bool, kColumns.size()> seen{};
        for (const std::string_view name : fields_) {
            const auto found = std::find_if(kColumns.begin(), kColumns.end(), [&](const Column& c) {
                return same_name(c.name, name);
            });
            const auto index = static_cast<std::size_t>(found - kColumns.begin());
            if (index != kNone && std::exchange(seen.at(index), true)) {
                fail(name, "found twice in the header, expected once");
            }
            roles_.push_back(index);
        }
        std::string missing;
        for (std::size_t i = 0; i < kNeeded; ++i) {
            if (!seen.at(i))
                missing += (missing.empty() ? "" : ", ") + std::string(kColumns.at(i).name);
        }
        if (!missing.empty()) {
            fail("", "found the header " + quoted(trim(without_byte_order_mark(*line))) +
                         ", expected also the column(s) " + missing);
        }
        refuse_misspelt(seen);
        // Of no profile there is no level: the column is somebody else's.
        if (!seen.at(kProfile)) std::ranges::replace(roles_, kLevel, kNone);
        own_role_ = seen.at(kFrequency) || seen.at(kProfile);
    }

    /// Ignored as a column of somebody's, one of these would leave the vibration to the
    /// configuration, or a simulation unmarked. `role` and `level_db` may be anybody's.
    void refuse_misspelt(const std::array<bool, kColumns.size()>& seen) const {
        for (std::size_t i = 0; i < fields_.size(); ++i) {
            if (roles_[i] != kNone || same_name(fields_[i], kSimulated)) continue;
            for (const auto& [meant, there] :
                 {std::pair{kColumns[kFrequency].name, seen[kFrequency]},
                  {kColumns[kProfile].name, seen[kProfile]},
                  {kSimulated, simulated_}}) {
                if (there || !misspelt(fields_[i], meant)) continue;
                std::string known;
                for (const Column& column : kColumns) known += std::string(column.name) + ", ";
                fail(fields_[i], "found an unknown name, perhaps for " + std::string(meant) +
                                     ", expected one of " + known + std::string(kSimulated) +
                                     ", or one that is unlike them");
            }
        }
    }

    /// Of a line without an end, which may be cut.
    void check_end() {
        // A profile, a level, a role may be left empty; an empty frequency would be rest.
        const bool read = fields_.size() == roles_.size() && roles_.back() < kProfile;
        const auto cut = cut_fields(fields_.size(), roles_.size(), fields_.back(), read);
        if (!cut.empty()) fail("", cut);
        warning_ = tell_open_end(path_ + ":" + std::to_string(lines_.line()), fields_.back());
    }

    RecordingRow row(std::string_view line) {
        split(line);
        if (!lines_.ended()) check_end();
        const bool trailing_comma = fields_.size() == roles_.size() + 1 && fields_.back().empty();
        if (fields_.size() != roles_.size() && !trailing_comma) {
            const bool decimal_commas =
                separator_ == ',' && fields_.size() > roles_.size() + kNeeded / 2;
            fail("", "found " + std::to_string(fields_.size()) + " fields, expected " +
                         std::to_string(roles_.size()) + " as in the header" +
                         (decimal_commas ? " (decimal commas want ';' or a tab between the fields)"
                                         : ""));
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
                case kFrequency:
                    row.frequency_hz = frequency(field);
                    break;
                case kProfile:
                    row.profile = profile(field);
                    break;
                case kLevel:
                    row.level_db = field.empty() ? 0 : real(role, field);
                    break;
                case kRole:
                    row.held_out = held_out(field);
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

    /// A column of this name may be anybody's, of operators say: it is this one where the file says
    /// of its vibration otherwise, too, or where one of its words is known.
    bool held_out(std::string_view field) {
        if (field.empty() || (other_role_ && field == other_role_->second)) return false;
        const bool verify = same_name("verify", field);
        if (!verify && !same_name("identify", field)) {
            if (own_role_ || misspelt_role(field)) refuse_role(lines_.line(), field);
            if (!other_role_) other_role_.emplace(lines_.line(), field);
            return false;
        }
        if (other_role_) refuse_role(other_role_->first, other_role_->second);
        own_role_ = true;
        return verify;
    }
    [[noreturn]] void refuse_role(std::size_t line, std::string_view field) const {
        throw RecordingError(path_, line, std::string(kColumns.at(kRole).name),
                             "found " + quoted(field) + ", expected \"identify\" or \"verify\"");
    }

    double frequency(std::string_view field) const {
        if (field.empty()) return 0;
        const double hz = real(kFrequency, field);
        if (hz < 0)
            fail(kColumns.at(kFrequency).name, "found " + quoted(field) + ", expected 0 or above");
        return hz;
    }

    std::uint16_t profile(std::string_view field) {
        double number = 1;
        if (field.empty() || (read_number(field, number) && number == 0)) return 0;
        const auto known = std::ranges::find(profiles_, field);
        const auto place = known - profiles_.begin();
        if (known == profiles_.end()) {
            if (profiles_.size() >= kMostProfiles)
                fail(kColumns.at(kProfile).name, "found " + quoted(field) + " after " +
                                                     std::to_string(kMostProfiles) +
                                                     " others, expected a profile of some dwells");
            profiles_.emplace_back(field);
        }
        return static_cast<std::uint16_t>(place + 1);
    }

    double real(std::size_t role, std::string_view field) const {
        const Column& column = kColumns.at(role);
        double value = 0;
        std::string with_point;
        std::string_view digits = field;
        // Where commas do not separate, they are decimal ones.
        if (separator_ != ',' && field.find(',') != std::string_view::npos) {
            with_point = field;
            with_point[field.find(',')] = '.';
            digits = with_point;
        }
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
        if (last_time_ && pair == dwell_ && !(row.time_s > *last_time_)) {
            fail(kColumns.at(kTime).name,
                 "found " + quoted(field) + ", expected more than " + text_of(*last_time_) +
                     ", the time before it in run " + std::to_string(row.run) + ", position " +
                     std::to_string(row.position));
        }
        const bool begins = !last_time_ || pair != dwell_;
        if (begins) copies_.begin(row.line);
        if (!begins && row.held_out != held_out_)
            fail(kColumns.at(kRole).name,
                 "found another role within run " + std::to_string(row.run) + ", position " +
                     std::to_string(row.position) + ", expected one for all of a dwell");
        last_time_ = row.time_s;
        dwell_ = pair;
        held_out_ = row.held_out;
        refuse_copy(row);
    }

    /// Taken as a measurement of its own, a copy would halve the variance of what it knows.
    void refuse_copy(const RecordingRow& row) {
        const std::size_t before = copies_.add(row);
        if (before == 0) return;
        throw RecordingError(path_, copies_.line(), "",
                             "found run " + std::to_string(row.run) + ", position " +
                                 std::to_string(row.position) +
                                 " with the samples of the dwell of line " +
                                 std::to_string(before) + ", expected each dwell once");
    }

    std::string path_, warning_;
    LineReader lines_;
    bool simulated_ = false;
    bool frequency_ = false, profile_ = false;
    std::vector<std::string> profiles_;  ///< by the numbers of the rows, from 1
    char separator_ = ',';
    std::vector<std::string_view> fields_;
    std::vector<std::size_t> roles_;  ///< index into kColumns by field, kNone: ignored
    bool own_role_ = false;           ///< the column `role` says which dwells are held out
    std::optional<std::pair<std::size_t, std::string>> other_role_;  ///< first of a word unknown
    std::pair<int, int> dwell_;
    std::optional<double> last_time_;  ///< of the dwell in force
    bool held_out_ = false;            ///< the dwell of the newest row
    CopiesSeen copies_;
};

RecordingError::RecordingError(const std::string& file, std::size_t line, const std::string& column,
                               const std::string& what)
    : std::runtime_error(locate(file, line, column, what)) {}

RecordingReader::RecordingReader(const std::string& path) : rows_(std::make_unique<Rows>(path)) {}
RecordingReader::~RecordingReader() = default;
bool RecordingReader::next(RecordingRow& row) { return rows_->next(row); }
bool RecordingReader::simulated() const { return rows_->simulated(); }
bool RecordingReader::has_frequency() const { return rows_->has_frequency(); }
bool RecordingReader::has_profile() const { return rows_->has_profile(); }
const std::vector<std::string>& RecordingReader::profiles() const { return rows_->profiles(); }
std::uint64_t RecordingReader::bytes() const { return rows_->bytes(); }
const std::string& RecordingReader::warning() const { return rows_->warning(); }

}  // namespace vibrig::proto
