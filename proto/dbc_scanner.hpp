#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace vibrig::proto {

/// A place in a DBC text; both count from 1, columns in bytes.
struct Position {
    int line = 1;
    int column = 1;
};

struct Token {
    enum class Kind : std::uint8_t { word, number, string, mark, end };
    Kind kind = Kind::end;
    std::string_view text;  ///< string: between its quotes, escapes as written
    Position at;
    bool first_on_line = false;
    [[nodiscard]] bool is_mark(char mark) const noexcept {
        return kind == Kind::mark && text[0] == mark;
    }
    [[nodiscard]] bool is_word(std::string_view word) const noexcept {
        return kind == Kind::word && text == word;
    }
};

/// Cuts a DBC text into tokens, one ahead. The text must outlive the scanner and its tokens.
class DbcScanner {
  public:
    DbcScanner(std::string_view text, std::string file);
    [[nodiscard]] const Token& peek() const noexcept { return ahead_; }
    Token next();

    /// "found <token>, expected <expected>" at the token.
    [[noreturn]] void fail(const Token& found, const std::string& expected) const;
    [[noreturn]] void fail_at(Position at, const std::string& what) const;

  private:
    [[nodiscard]] Token scan();
    [[nodiscard]] Token scan_string();
    void skip_space();
    void step();

    std::string_view text_;
    std::string file_;
    std::size_t offset_ = 0;
    Position at_;
    bool line_begins_ = true;
    Token ahead_;
};

/// The value of a string token: escapes resolved, and UTF-8 whatever the file held. Bytes that are
/// no UTF-8 are read as Latin-1, which is what older editors write.
[[nodiscard]] std::string string_value(const Token& token);

}  // namespace vibrig::proto
