#include "proto/dbc_scanner.hpp"

#include <utility>

#include "proto/dbc.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

namespace {

bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }
bool is_word_start(char c) noexcept {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}
bool is_word_part(char c) noexcept { return is_word_start(c) || is_digit(c); }

std::size_t number_length(std::string_view text) noexcept {
    std::size_t n = 0;
    while (n < text.size()) {
        const bool exponent_sign = n > 0 && (text[n] == '+' || text[n] == '-') &&
                                   (text[n - 1] == 'e' || text[n - 1] == 'E');
        // Letters and '#' stay inside, so that "12abc" and "1.#INF" are quoted whole in the error.
        if (!exponent_sign && !is_word_part(text[n]) && text[n] != '.' && text[n] != '#') break;
        ++n;
    }
    return n;
}

std::string describe(const Token& token) {
    if (token.kind == Token::Kind::end) return "end of file";
    const std::string text = printable(token.text);
    return token.kind == Token::Kind::string ? "string \"" + text + "\"" : "'" + text + "'";
}

}  // namespace

DbcScanner::DbcScanner(std::string_view text, std::string file)
    : text_(without_byte_order_mark(text)), file_(std::move(file)), ahead_(scan()) {}

Token DbcScanner::next() {
    const Token token = ahead_;
    if (token.kind != Token::Kind::end) ahead_ = scan();
    return token;
}

void DbcScanner::fail(const Token& found, const std::string& expected) const {
    fail_at(found.at, "found " + describe(found) + ", expected " + expected);
}

void DbcScanner::fail_at(Position at, const std::string& what) const {
    throw DbcError(file_, at.line, at.column, what);
}

void DbcScanner::step() {
    if (text_[offset_] == '\n') {
        ++at_.line;
        at_.column = 1;
        line_begins_ = true;
    } else {
        ++at_.column;
    }
    ++offset_;
}

void DbcScanner::skip_space() {
    while (offset_ < text_.size()) {
        const char c = text_[offset_];
        if (c == '/' && text_.substr(offset_, 2) == "//") {
            while (offset_ < text_.size() && text_[offset_] != '\n') step();
        } else if (c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v') {
            step();
        } else {
            return;
        }
    }
}

Token DbcScanner::scan() {
    skip_space();
    Token token;
    token.at = at_;
    token.first_on_line = std::exchange(line_begins_, false);
    if (offset_ >= text_.size()) return token;
    const char c = text_[offset_];
    if (c == '"') {
        Token quoted = scan_string();
        quoted.at = token.at;
        quoted.first_on_line = token.first_on_line;
        return quoted;
    }
    std::size_t length = 1;
    token.kind = Token::Kind::mark;
    const std::string_view rest = text_.substr(offset_);
    if (is_word_start(c)) {
        token.kind = Token::Kind::word;
        while (length < rest.size() && is_word_part(rest[length])) ++length;
    } else if (is_digit(c) || (c == '.' && rest.size() > 1 && is_digit(rest[1]))) {
        token.kind = Token::Kind::number;
        length = number_length(rest);
    }
    token.text = rest.substr(0, length);
    for (std::size_t i = 0; i < length; ++i) step();
    return token;
}

Token DbcScanner::scan_string() {
    const Position begin = at_;
    step();
    const std::size_t first = offset_;
    while (offset_ < text_.size() && text_[offset_] != '"') {
        const bool escaped_quote = text_.substr(offset_, 2) == "\\\"";
        step();
        if (escaped_quote) step();
    }
    if (offset_ >= text_.size()) {
        fail_at(begin, "found a string that never ends, expected its closing '\"'");
    }
    Token token;
    token.kind = Token::Kind::string;
    token.text = text_.substr(first, offset_ - first);
    step();
    line_begins_ = false;  // what follows a string of several lines does not begin a line
    return token;
}

std::string string_value(const Token& token) {
    std::string plain;
    plain.reserve(token.text.size());
    for (std::size_t i = 0; i < token.text.size(); ++i) {
        if (token.text.substr(i, 2) == "\\\"") ++i;
        plain += token.text[i];
    }
    return is_utf8(plain) ? plain : utf8_from_latin1(plain);
}

}  // namespace vibrig::proto
