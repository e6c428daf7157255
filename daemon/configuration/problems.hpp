#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vibrig::configuration {

/// Where something stands in the file, from 1; line 0: it does not stand there (a default).
struct Place {
    std::uint32_t line = 0;
    std::uint32_t column = 0;
};

struct Problem {
    Place place;
    std::string key;
    std::string found;
    std::string expected;  ///< empty: `found` says it
};

/// Everything wrong with one file, so that a person mends it in one go.
class Problems {
  public:
    void add(Place place, std::string key, std::string found, std::string expected);
    [[nodiscard]] bool empty() const { return problems_.empty(); }
    [[nodiscard]] std::size_t count() const { return problems_.size(); }
    /// True if the key itself, or something within it, has a problem already.
    [[nodiscard]] bool concern(const std::string& key) const;
    /// "file:line:column: key: found X, expected Y", one per line in the order of the file.
    [[nodiscard]] std::string text(const std::string& file) const;

  private:
    std::vector<Problem> problems_;
};

/// Bytes of a value that is quoted.
inline constexpr std::size_t kQuotedValue = 60;

}  // namespace vibrig::configuration
