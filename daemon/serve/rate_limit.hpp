#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

namespace vibrig::serve {

/// So many a second on average, a burst at once.
class TokenBucket {
  public:
    using Instant = std::chrono::steady_clock::time_point;

    TokenBucket(double per_s, double burst) : per_s_(per_s), burst_(burst), left_(burst) {}
    [[nodiscard]] bool take(Instant now);
    [[nodiscard]] bool full(Instant now) const noexcept;
    /// Times there was nothing left, since it was asked last.
    [[nodiscard]] std::uint64_t missed() noexcept { return std::exchange(missed_, 0); }

  private:
    [[nodiscard]] double left_at(Instant now) const noexcept;

    double per_s_, burst_, left_;
    std::uint64_t missed_ = 0;
    Instant last_{};
};

/// A bucket for each who comes, so that nobody uses up another's; bounded: who comes when there are
/// kMost not yet full again shares one with all others who do.
class TokenBuckets {
  public:
    static constexpr std::size_t kMost = 64;

    TokenBuckets(double per_s, double burst) : fresh_(per_s, burst), shared_(fresh_) {}
    [[nodiscard]] TokenBucket& of(const std::string& identity, TokenBucket::Instant now);

  private:
    const TokenBucket fresh_;
    TokenBucket shared_;
    std::map<std::string, TokenBucket> own_;
};

}  // namespace vibrig::serve
