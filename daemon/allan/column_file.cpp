#include "daemon/allan/column_file.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "daemon/allan/packed_input.hpp"
#include "proto/open_end.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

constexpr std::size_t kChunk = 1 << 20;
constexpr std::size_t kLongestLine = 1 << 16;
constexpr std::size_t kNoColumn = std::numeric_limits<std::size_t>::max();
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

bool is_missing(std::string_view field) {
    return field.empty() || field == "nan" || field == "NaN" || field == "NAN" || field == "NA" ||
           field == "null";
}

std::string shown(std::string_view text) { return "\"" + proto::printable(text, 40) + "\""; }

class Parser {
  public:
    Parser(std::string path, const ColumnRequest& request)
        : path_(std::move(path)), request_(request) {}

    /// `open`: it has no end.
    void line(std::string_view text, bool open = false) {
        ++number_;
        if (number_ == 1) text = without_mark(text);
        const std::string_view content = proto::trimmed(text);
        if (content.empty()) {
            // The only field of the row is empty; at the end of the file it is no row.
            blank_ += single_ && !file_.values.empty() ? 1U : 0U;
            return;
        }
        if (is_comment(content)) return;
        if (!known_ && first(content)) {
            return;
        }
        if (open) check_end(content);
        file_.values.insert(file_.values.end(), std::exchange(blank_, 0U), kMissing);
        file_.values.push_back(field(text, value_, file_.column));
        if (time_ != kNoColumn) {
            file_.times.push_back(field(text, time_, request_.time));
        }
    }

    ColumnFile take() {
        if (!known_) {
            throw std::runtime_error(path_ + ": no data found, expected lines of numbers");
        }
        return std::move(file_);
    }

    [[noreturn]] void fail(const std::string& what) const {
        throw std::runtime_error(path_ + ":" + std::to_string(number_) + ": " + what);
    }

  private:
    void check_end(std::string_view text) {
        std::size_t count = 0;
        std::string_view last;
        for (; text.data() != nullptr; ++count) last = next(text);
        const bool read = fields_ == std::max(value_, time_ == kNoColumn ? 0 : time_) + 1;
        const auto cut = proto::cut_fields(count, fields_, last, read);
        if (!cut.empty()) fail(cut);
        file_.warning = proto::tell_open_end(path_ + ":" + std::to_string(number_), last);
    }

    /// Next field of `rest`, which loses it.
    std::string_view next(std::string_view& rest) const {
        if (separator_ == ' ') {
            rest = proto::trimmed(rest);
        }
        std::size_t end = separator_ == ' ' ? rest.find_first_of(" \t") : rest.find(separator_);
        end = std::min(end, rest.size());
        const std::string_view found = rest.substr(0, end);
        // Nothing after the last field differs from an empty field after the last separator.
        rest = end == rest.size() ? std::string_view() : rest.substr(end + 1);
        return proto::trimmed(found);
    }

    double field(std::string_view text, std::size_t index, const std::string& name) const {
        std::string_view found;
        for (std::size_t i = 0; i <= index; ++i) {
            if (i > 0 && text.data() == nullptr) {
                fail(std::to_string(i) + " columns found, expected column " +
                     std::to_string(index + 1) + " (" + name + ")");
            }
            found = next(text);
        }
        double value = 0;
        if (!read_sample(found, value)) {
            fail("column " + name + ": " + shown(found) + " found, expected a finite number");
        }
        return value;
    }

    /// Separator, header and columns from the first line; true if it was a header.
    bool first(std::string_view content) {
        known_ = true;
        if (std::any_of(content.begin(), content.end(),
                        [](char c) { return static_cast<unsigned char>(c) < 0x20 && c != '\t'; })) {
            fail("binary data found, expected lines of numbers");
        }
        for (const char candidate : {',', ';', '\t'}) {
            if (content.find(candidate) != std::string_view::npos) {
                separator_ = candidate;
                break;
            }
        }
        std::vector<std::string> fields;
        for (std::string_view rest = content; rest.data() != nullptr;) {
            fields.emplace_back(next(rest));
        }
        const bool header = std::any_of(fields.begin(), fields.end(), [](const std::string& f) {
            double ignored = 0;
            return !read_sample(f, ignored);
        });
        if (header && fields.size() == 1 && !is_name(content)) {
            fail(shown(content) + " found, expected a number or a column's name");
        }
        if (!header) {
            for (std::size_t i = 0; i < fields.size(); ++i) {
                fields[i] = std::to_string(i + 1);
            }
        }
        if (request_.column.empty() && fields.size() > 1) {
            fail("the columns " + joined(fields) + " found; choose one with --column");
        }
        value_ = request_.column.empty() ? 0 : index_of(fields, request_.column);
        time_ = request_.time.empty() ? kNoColumn : index_of(fields, request_.time);
        fields_ = fields.size();
        single_ = fields_ == 1;
        file_.column = fields[value_];
        return header;
    }

    std::size_t index_of(const std::vector<std::string>& fields, const std::string& name) const {
        auto at = std::ranges::find(fields, name);
        if (at == fields.end())
            at = std::ranges::find_if(fields, [&name](const std::string& field) {
                return proto::same_name(field, name);
            });
        if (at != fields.end()) {
            return static_cast<std::size_t>(at - fields.begin());
        }
        std::size_t position = 0;
        if (proto::read_number(name, position) && position >= 1 && position <= fields.size())
            return position - 1;
        fail("no column \"" + name + "\", found " + joined(fields));
    }

    static std::string joined(const std::vector<std::string>& fields) {
        std::string all;
        for (const std::string& f : fields) {
            all += (all.empty() ? "" : ", ") + proto::printable(f);
        }
        return all;
    }

    std::string path_;
    ColumnRequest request_;
    ColumnFile file_;
    std::size_t number_ = 0;
    std::size_t blank_ = 0;  ///< rows since the last number
    std::size_t value_ = 0, fields_ = 0;
    std::size_t time_ = kNoColumn;
    char separator_ = ' ';
    bool single_ = false;
    bool known_ = false;
};

/// What `act` gives; an error with the file's name before it.
template <class Act>
auto reading(const std::string& path, const Act& act) {
    try {
        return act();
    } catch (const std::runtime_error& error) {
        throw std::runtime_error(path + ": cannot be read: " + error.what());
    }
}

}  // namespace

bool read_sample(std::string_view field, double& value) {
    if (is_missing(field)) {
        value = kMissing;
        return true;
    }
    field.remove_prefix(field.front() == '+' ? 1 : 0);
    return proto::read_number(field, value) && std::isfinite(value);
}

std::string_view without_mark(std::string_view text) {
    return text.substr(text.starts_with("\xEF\xBB\xBF") ? 3 : 0);
}

bool is_comment(std::string_view content) {
    return content.starts_with('#') || content.starts_with('%');
}

bool is_name(std::string_view word) {
    double ignored = 0;
    return !read_sample(word, ignored) && word.find_first_of("0123456789+-.") != 0;
}

ColumnFile read_columns(const std::string& path, const ColumnRequest& request,
                        const std::function<void(std::size_t, std::size_t)>& progress) {
    std::error_code no_size;
    if (std::filesystem::is_directory(path, no_size)) {
        throw std::runtime_error(path + ": is a folder, expected a file");
    }
    const std::uintmax_t bytes = path == "-" ? 0 : std::filesystem::file_size(path, no_size);
    const auto file = reading(path, [&] { return std::make_unique<PackedInput>(path); });
    Parser parser(path, request);
    std::vector<char> buffer(kChunk + kLongestLine);
    std::size_t kept = 0;
    for (;;) {
        const std::size_t got =
            reading(path, [&] { return file->read(buffer.data() + kept, kChunk); });
        const std::string_view text(buffer.data(), kept + got);
        std::size_t begin = 0;
        for (std::size_t end = text.find('\n'); end != std::string_view::npos;
             end = text.find('\n', begin)) {
            parser.line(text.substr(begin, end - begin));
            begin = end + 1;
        }
        if (got == 0) {
            if (begin < text.size()) {
                parser.line(text.substr(begin), true);
            }
            return parser.take();
        }
        kept = text.size() - begin;
        if (kept > kLongestLine) {
            parser.fail("a line of more than " + std::to_string(kLongestLine) +
                        " characters follows, expected lines of numbers");
        }
        std::copy(text.begin() + static_cast<std::ptrdiff_t>(begin), text.end(), buffer.begin());
        if (progress) {
            progress(file->taken(), no_size ? 0 : static_cast<std::size_t>(bytes));
        }
    }
}

}  // namespace vibrig::tool
