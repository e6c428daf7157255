#pragma once

#include <cstdint>
#include <string>

namespace vibrig::record {

/// A disk that refused is tried again after so long.
inline constexpr std::int64_t kRetryNs = 1'000'000'000;

/// Tells other programs that a file is being written; the system forgets it with the process. What
/// cannot be locked is not.
class WriterLock {
  public:
    explicit WriterLock(const std::string& path);
    ~WriterLock();
    WriterLock(const WriterLock&) = delete;
    WriterLock& operator=(const WriterLock&) = delete;

    /// By anybody.
    [[nodiscard]] static bool held(const std::string& path);

  private:
    int file_;
};

/// Empty if `folder` has `keep_free_mb` left, or if nobody knows; else what was found and expected.
[[nodiscard]] std::string lack_of_room(const std::string& folder, double keep_free_mb);

}  // namespace vibrig::record
