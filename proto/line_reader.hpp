#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace vibrig::proto {

/// Reads a text file once, line by line, in bounded memory. Throws std::runtime_error with the
/// cause, without path and line: the caller names them in its own error.
class LineReader {
  public:
    static constexpr std::size_t kMaximumLine = std::size_t{1} << 20;  ///< bytes

    explicit LineReader(const std::string& path);
    /// The next line without its end (LF or CRLF), valid until the next call.
    [[nodiscard]] std::optional<std::string_view> next();
    /// Number of the line that next() returned or failed at, from 1.
    [[nodiscard]] std::size_t line() const noexcept { return line_; }
    /// The line that next() returned has an end; the last of a file may have none.
    [[nodiscard]] bool ended() const noexcept { return ended_; }
    [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }  ///< read of the file

  private:
    struct Close {
        void operator()(std::FILE* file) const noexcept { (void)std::fclose(file); }
    };

    [[nodiscard]] bool fill();
    [[nodiscard]] std::string_view take(std::size_t length);

    std::unique_ptr<std::FILE, Close> file_;
    std::string buffer_;
    std::size_t begin_ = 0;
    std::size_t end_ = 0;
    std::size_t line_ = 0;
    std::uint64_t bytes_ = 0;
    bool ended_ = true;
};

}  // namespace vibrig::proto
