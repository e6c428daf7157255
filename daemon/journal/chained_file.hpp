#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/journal/chain.hpp"
#include "daemon/journal/database.hpp"
#include "daemon/journal/signed_head.hpp"
#include "daemon/journal/signing_key.hpp"

namespace vibrig::journal {

/// Beside the journal.
inline constexpr const char* kHeadSuffix = ".head";
inline constexpr const char* kKeySuffix = ".key";

/// The journal's file with its chain, its signed head and the key. One thread; what reads or writes
/// throws DatabaseError.
class ChainedFile {
  public:
    using FirstRows = std::function<void()>;

    /// `anchors`: heads that are kept elsewhere, which it has to go through.
    ChainedFile(std::string path, std::vector<Anchor> anchors)
        : path_(std::move(path)), anchors_(std::move(anchors)) {}

    /// Opens or makes it, and compares what can be compared within a second. What is missing or
    /// changed, in words: then it has to be replaced. Empty: it is what was written into it.
    [[nodiscard]] std::vector<std::string> open();
    /// Puts it aside, as far as it is there, and begins a new one, with `first_rows` (which calls
    /// chained()) in the transaction that makes it. Again, if it throws.
    void replace(const std::vector<std::string>& found, const FirstRows& first_rows);

    [[nodiscard]] Database& database();
    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    /// Where what was replaced is now; how the chain begins, if it began with this start.
    [[nodiscard]] const std::string& aside() const noexcept { return aside_; }
    [[nodiscard]] const std::string& begins() const noexcept { return begins_; }

    void begin();
    void chained(std::string_view table, std::int64_t row) {
        chain_.append(database(), table, row);
    }
    void commit();
    void roll_back() noexcept;
    /// Writes the head beside it; empty, or why that failed. It may lag behind, and is never ahead.
    [[nodiscard]] std::string publish();
    /// Another program has written into it since this was last asked.
    [[nodiscard]] bool changed_by_others();

    [[nodiscard]] const SignedHead& head() const noexcept { return head_; }
    [[nodiscard]] const Link& newest() const noexcept { return chain_.last(); }
    /// Head of an entry of its own, signed anew; nothing: the chain has no such row.
    [[nodiscard]] std::optional<SignedHead> head_of(std::string_view table, std::int64_t row);
    [[nodiscard]] std::string public_key() const { return key_ ? key_->public_key() : ""; }
    /// By open(): all of its rows; SQLite's own integrity.
    [[nodiscard]] bool verified() const noexcept { return verified_; }
    [[nodiscard]] bool intact() const noexcept { return intact_; }

  private:
    void open_database(const FoundHead& beside, std::vector<std::string>& found);
    void take_key(std::vector<std::string>& found);
    void check_start(const FoundHead& beside, std::vector<std::string>& found);
    void check_head(const FoundHead& beside, std::vector<std::string>& found);
    void check_anchors(std::vector<std::string>& found);
    void check_rows(std::vector<std::string>& found);
    [[nodiscard]] bool came_before(const std::string& chain) const;
    void remember_previous();
    void put_aside();
    [[nodiscard]] bool key_is_there() const;
    void make(const std::string& begins, const FirstRows& first_rows);

    const std::string path_;
    const std::vector<Anchor> anchors_;
    std::unique_ptr<Database> database_;
    std::optional<SigningKey> key_;
    Chain chain_{Link{}};
    Link before_;       ///< the transaction in progress
    std::string name_;  ///< of the chain
    SignedHead head_;
    std::vector<std::string> previous_;  ///< chains that came before this one, oldest first
    std::string aside_, begins_;
    bool moved_ = false;  ///< replace() has put it aside and not yet begun a new one
    bool verified_ = false, intact_ = false;
    std::int64_t data_version_ = 0;
};

}  // namespace vibrig::journal
