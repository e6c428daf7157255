#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

namespace vibrig::serve {

/// "2027-03-31"; UTC.
[[nodiscard]] std::string date_of(std::int64_t utc_s);

/// Says of each certificate that it ends: 30 days before, 7 days before, and when it has ended;
/// each once.
class ExpiryWatch {
  public:
    /// What is to be reported now; empty: nothing. Times in s, UTC.
    [[nodiscard]] std::string check(const std::string& whose, std::int64_t expires,
                                    std::int64_t now);

  private:
    static constexpr std::size_t kMostKnown = 1000;  // strangers cannot fill it: all are certified
    /// When it ends, and what has been reported of it.
    std::map<std::string, std::pair<std::int64_t, int>> reported_;
};

}  // namespace vibrig::serve
