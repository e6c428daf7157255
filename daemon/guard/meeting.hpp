#pragma once

#include <optional>
#include <string>

#include "drivers/base/clock.hpp"
#include "proto/guard_words.hpp"

namespace vibrig::guard {

/// Where daemon and guard meet: a Unix seqpacket socket on which the guard listens. One daemon at a
/// time; a new one takes the place of the old. Nothing here waits.
class Meeting {
  public:
    /// Throws std::runtime_error: the place is taken by another guard, or cannot be had.
    explicit Meeting(const std::string& path);
    ~Meeting();
    Meeting(const Meeting&) = delete;
    Meeting& operator=(const Meeting&) = delete;

    /// Takes who knocks and what was said. True when there was a word.
    bool attend(drivers::Time now);
    void tell(const proto::GuardWord& word) noexcept;
    /// The newest word, kept when the daemon is gone.
    [[nodiscard]] const std::optional<proto::DaemonWord>& word() const noexcept { return word_; }
    [[nodiscard]] drivers::Time heard() const noexcept { return heard_; }
    [[nodiscard]] bool connected() const noexcept { return daemon_ >= 0; }
    /// Packets that were no words.
    [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

  private:
    void hang_up() noexcept;

    std::string path_;
    int listener_ = -1, daemon_ = -1;
    std::optional<proto::DaemonWord> word_;
    drivers::Time heard_ = 0;
    std::uint64_t refused_ = 0;
};

}  // namespace vibrig::guard
