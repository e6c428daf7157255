#include "proto/candump.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <utility>

#include "proto/text.hpp"

namespace vibrig::proto {

namespace {

constexpr std::uint32_t kErrorFlag = 0x20000000U;  // CAN_ERR_FLAG, as the log writes error frames
constexpr std::uint32_t kLargestStandard = 0x7ffU;
constexpr std::uint32_t kLargestExtended = 0x1fffffffU;
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
constexpr std::size_t kInterfaceLength = 15;  // IFNAMSIZ - 1

[[noreturn]] void fail(std::string_view found, const std::string& expected) {
    throw CandumpError("found '" + printable(found) + "', expected " + expected);
}

template <typename Number>
bool read_hex(std::string_view text, Number& out) noexcept {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out, 16);
    return !text.empty() && error == std::errc() && end == text.data() + text.size();
}

bool is_size(const LoggedFrame& frame) noexcept {
    if (frame.size <= 8) return true;
    static constexpr std::array<unsigned, 7> kLong = {12, 16, 20, 24, 32, 48, 64};
    return frame.fd && std::find(kLong.begin(), kLong.end(), frame.size) != kLong.end();
}

bool is_blank(char c) noexcept { return c == ' ' || c == '\t'; }

std::string_view next_word(std::string_view& text) noexcept {
    const auto begin = std::find_if_not(text.begin(), text.end(), is_blank);
    const auto end = std::find_if(begin, text.end(), is_blank);
    const std::string_view word(begin, end);
    text = {end, text.end()};
    return word;
}

std::int64_t parse_time(std::string_view word) {
    const std::string expected = "a time such as (1700000000.123456)";
    if (!word.starts_with('(') || !word.ends_with(')')) fail(word, expected);
    const std::string_view inner = word.substr(1, word.size() - 2);
    const std::size_t point = std::min(inner.find('.'), inner.size());
    const std::string_view fraction = inner.substr(std::min(point + 1, inner.size()));
    std::uint64_t seconds = 0;
    std::uint64_t part = 0;
    // In the year 2116: differences and sums of two times fit into 64 bits.
    constexpr std::uint64_t kMost = (std::int64_t{1} << 62) / kNanosecondsPerSecond - 1;
    if (!read_number(inner.substr(0, point), seconds) || seconds > kMost || fraction.size() > 9 ||
        !read_number(fraction, part)) {
        fail(word, expected);
    }
    for (std::size_t digits = fraction.size(); digits < 9; ++digits) part *= 10;
    return static_cast<std::int64_t>(seconds) * kNanosecondsPerSecond +
           static_cast<std::int64_t>(part);
}

void parse_id(std::string_view text, LoggedFrame& frame) {
    std::uint32_t id = 0;
    const bool is_hex = read_hex(text, id);
    if (is_hex && text.size() == 3 && id <= kLargestStandard) {
        frame.id = id;
    } else if (is_hex && text.size() == 8 && id <= kLargestExtended) {
        frame.id = id;
        frame.extended = true;
    } else if (is_hex && text.size() == 8 && id <= (kErrorFlag | kLargestExtended)) {
        frame.id = id & ~kErrorFlag;
        frame.error = true;
    } else {
        fail(text, "an identifier of 3 hexadecimal digits (to 7FF) or 8 (to 1FFFFFFF)");
    }
}

void parse_data(std::string_view text, LoggedFrame& frame) {
    if (text.size() % 2 != 0 || text.size() / 2 > frame.data.size()) {
        fail(text, "data as pairs of hexadecimal digits");
    }
    frame.size = static_cast<std::uint8_t>(text.size() / 2);
    if (!is_size(frame)) {
        fail(text, frame.fd ? "0 to 8, 12, 16, 20, 24, 32, 48 or 64 bytes" : "at most 8 bytes");
    }
    for (std::size_t i = 0; i < frame.size; ++i) {
        if (!read_hex(text.substr(2 * i, 2), frame.data.at(i))) {
            fail(text, "data as pairs of hexadecimal digits");
        }
    }
}

void parse_frame(std::string_view word, LoggedFrame& frame) {
    const std::size_t mark = word.find('#');
    if (mark == std::string_view::npos) fail(word, "a frame such as 123#1122 or 123##1AABB");
    parse_id(word.substr(0, mark), frame);
    std::string_view rest = word.substr(mark + 1);
    if (rest.starts_with('#')) {
        frame.fd = true;
        if (rest.size() < 2 || !read_hex(rest.substr(1, 1), frame.fd_flags)) {
            fail(word, "a digit of CAN FD flags after ##");
        }
        parse_data(rest.substr(2), frame);
    } else if (rest.starts_with('R') || rest.starts_with('r')) {
        frame.remote = true;
        rest.remove_prefix(1);
        if (!rest.empty() && (!read_number(rest, frame.size) || frame.size > 8)) {
            fail(word, "R and a length of at most 8");
        }
    } else {
        // After 8 bytes "_9" to "_F" may give the raw length code, which carries no data.
        if (rest.size() == 18 && rest[16] == '_') rest.remove_suffix(2);
        parse_data(rest, frame);
    }
}

}  // namespace

std::string candump_line(const LoggedFrame& frame) {
    const bool named = !frame.interface.empty() && frame.interface.size() <= kInterfaceLength &&
                       frame.interface.find_first_of(" \t\r\n") == std::string::npos;
    const bool identified =
        frame.id <= (frame.extended || frame.error ? kLargestExtended : kLargestStandard);
    if (!named || !identified || !is_size(frame) || frame.time_ns < 0 || frame.fd_flags > 15 ||
        (frame.remote && frame.fd)) {
        throw CandumpError("found frame id " + std::to_string(frame.id) + " of " +
                           std::to_string(frame.size) + " bytes on '" + printable(frame.interface) +
                           "', expected one that a bus can carry");
    }
    std::array<char, 64> head{};
    const std::uint32_t id = frame.error ? frame.id | kErrorFlag : frame.id;
    std::snprintf(head.data(), head.size(), "(%010lld.%06lld) ",
                  static_cast<long long>(frame.time_ns / kNanosecondsPerSecond),
                  static_cast<long long>(frame.time_ns % kNanosecondsPerSecond / 1000));
    std::string line = head.data() + frame.interface;
    std::snprintf(head.data(), head.size(), frame.extended || frame.error ? " %08X#" : " %03X#",
                  static_cast<unsigned>(id));
    line += head.data();
    static constexpr std::string_view kDigits = "0123456789ABCDEF";
    if (frame.remote) {
        line += 'R';
        if (frame.size > 0) line += kDigits[frame.size];
        return line;
    }
    if (frame.fd) {
        line += '#';
        line += kDigits[frame.fd_flags];
    }
    for (std::size_t i = 0; i < frame.size; ++i) {
        line += kDigits[frame.data.at(i) >> 4];
        line += kDigits[frame.data.at(i) & 15];
    }
    return line;
}

LoggedFrame parse_candump_line(std::string_view text) {
    LoggedFrame frame;
    frame.time_ns = parse_time(next_word(text));
    const std::string_view interface = next_word(text);
    if (interface.empty() || interface.size() > kInterfaceLength) {
        fail(interface, "an interface's name of at most 15 letters");
    }
    frame.interface = interface;
    parse_frame(next_word(text), frame);
    const std::string_view direction = next_word(text);
    const std::string_view rest = next_word(text);
    if (!rest.empty() || !(direction.empty() || direction == "R" || direction == "T")) {
        fail(rest.empty() ? direction : rest, "the line's end, or R or T before it");
    }
    return frame;
}

CandumpReader::CandumpReader(std::string path) : path_(std::move(path)) {
    try {
        lines_.emplace(path_);
    } catch (const std::runtime_error& error) {
        throw CandumpError(path_ + ": " + error.what());
    }
}

std::optional<LoggedFrame> CandumpReader::next() {
    try {
        while (const auto line = lines_->next()) {
            const std::size_t begin = line->find_first_not_of(" \t");
            if (begin != std::string_view::npos && (*line)[begin] != '#') {
                return parse_candump_line(*line);
            }
        }
    } catch (const std::runtime_error& error) {
        throw CandumpError(path_ + ":" + std::to_string(lines_->line()) + ": " + error.what());
    }
    return std::nullopt;
}

}  // namespace vibrig::proto
