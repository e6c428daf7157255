// The parser's small steps: one token or number each, with what was expected in the error.
#include <cmath>
#include <limits>

#include "proto/dbc_parser.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

Token DbcParser::word(const std::string& expected) {
    const Token token = scanner_.next();
    if (token.kind != Token::Kind::word) scanner_.fail(token, expected);
    return token;
}

Token DbcParser::string(const std::string& expected) {
    const Token token = scanner_.next();
    if (token.kind != Token::Kind::string) scanner_.fail(token, expected);
    return token;
}

void DbcParser::mark(char expected) {
    const Token token = scanner_.next();
    if (!token.is_mark(expected)) scanner_.fail(token, std::string("'") + expected + "'");
}

double DbcParser::number(const std::string& expected) {
    bool negative = false;
    if (scanner_.peek().is_mark('-') || scanner_.peek().is_mark('+')) {
        negative = scanner_.next().is_mark('-');
    }
    const Token token = scanner_.next();
    double value = 0;
    if (token.kind != Token::Kind::number || !read_number(token.text, value)) {
        scanner_.fail(token, expected + ", a finite number");
    }
    return negative ? -value : value;
}

std::uint64_t DbcParser::whole_number(std::uint64_t maximum, const std::string& expected) {
    const Token token = scanner_.next();
    std::uint64_t value = 0;
    if (token.kind != Token::Kind::number || !read_number(token.text, value) || value > maximum) {
        scanner_.fail(token, expected);
    }
    return value;
}

std::int64_t DbcParser::raw_value() {
    const std::string expected = "a whole number of at most 64 bits";
    const bool negative = scanner_.peek().is_mark('-');
    if (negative) scanner_.next();
    const Token token = scanner_.peek();
    constexpr std::uint64_t kLowest = std::uint64_t{1} << 63;
    std::uint64_t value = 0;
    double real = 0;
    if (token.kind == Token::Kind::number && read_number(token.text, value)) {
        scanner_.next();
        if (negative && value > kLowest) scanner_.fail(token, expected);
        // Two's complement, so that an unsigned value above 2^63 has its bit pattern as the key.
        return static_cast<std::int64_t>(negative ? ~value + 1 : value);
    }
    // Some editors write whole numbers as "3.0".
    if (token.kind != Token::Kind::number || !read_number(token.text, real) ||
        real != std::floor(real) || real >= static_cast<double>(kLowest)) {
        scanner_.fail(token, expected);
    }
    scanner_.next();
    return static_cast<std::int64_t>(negative ? -real : real);
}

std::uint32_t DbcParser::cycle_time() {
    const std::string expected = "a cycle time of 0 to 4294967295 ms";
    const Token token = scanner_.peek();
    const double value = std::round(number(expected));
    if (!(value >= 0 && value <= std::numeric_limits<std::uint32_t>::max())) {
        scanner_.fail(token, expected);
    }
    return static_cast<std::uint32_t>(value);
}

}  // namespace vibrig::proto
