#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "daemon/domain/latch.hpp"

namespace vibrig::journal {

/// Names of latches that are no row of the interlock's table.
inline constexpr const char* kDiedArmed = "died_armed";
inline constexpr const char* kJournalLatch = "journal";

/// What has stopped the shaker or forbids arming, until named persons acknowledge it. One thread.
class Latches {
  public:
    /// Adds what an earlier life left, or what happens now. The same name again: its
    /// acknowledgement begins anew.
    void add(Latch latch);
    [[nodiscard]] const std::vector<Latch>& open() const noexcept { return open_; }
    /// Those that keep the state tripped: all but the journal's.
    [[nodiscard]] bool tripped() const noexcept;
    /// Their causes in words.
    [[nodiscard]] std::string causes() const;
    [[nodiscard]] const Latch* find(std::string_view name) const noexcept;

    struct Answer {
        bool accepted = false;
        std::string words;               ///< what is over and what is not, or why refused
        std::vector<std::string> over;   ///< names
        std::vector<std::string> first;  ///< names; another person has still to acknowledge them
    };
    /// `what`: a name; "trip" or "shaker": every one but the journal's. Where two persons are
    /// needed, the second is another one than who armed or acknowledged first.
    Answer acknowledge(std::string_view what, const std::string& by);

  private:
    std::vector<Latch> open_;
};

}  // namespace vibrig::journal
