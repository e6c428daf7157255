#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/journal/signed_head.hpp"

namespace vibrig::journal {

class Database;

/// Appends what was written to the chain, in the transaction that writes it. One thread.
class Chain {
  public:
    /// The newest link of the file, and the name of its chain; empty: it has no entry.
    [[nodiscard]] static Link newest(Database& database);
    [[nodiscard]] static std::string name_of(Database& database);

    explicit Chain(Link last) : last_(std::move(last)) {}
    /// A row as it is now: a new one, or one that was changed.
    void append(Database& database, std::string_view table, std::int64_t row);
    /// Every row of every table but `origin`, as one found them.
    void take_over(Database& database);
    [[nodiscard]] const Link& last() const noexcept { return last_; }
    void rewind(Link last) { last_ = std::move(last); }  ///< after a rollback

  private:
    Link last_;
};

/// Walks over the chain and compares: hashes with each other, rows with what the chain has of them,
/// and at the end whether there are rows that it has not. A step at a time, each in a transaction
/// of the caller's. What is missing or changed is named.
class Verification {
  public:
    /// From the entry after `from`, which is believed. `strangers`: rows that are in no entry are
    /// looked for at the end.
    explicit Verification(Link from, bool strangers = true)
        : at_(std::move(from)), strangers_(strangers) {}
    Verification() = default;  ///< of all
    /// So many entries, or bytes of rows, at most. Throws DatabaseError.
    void step(Database& database, std::int64_t entries, std::size_t bytes);
    [[nodiscard]] bool done() const noexcept { return done_; }
    [[nodiscard]] const Link& at() const noexcept { return at_; }
    /// In words; after the first kMostNamed no more.
    [[nodiscard]] const std::vector<std::string>& found() const noexcept { return found_; }

    static constexpr std::size_t kMostNamed = 20;

  private:
    void name(std::string what);
    void compare_row(Database& database, std::int64_t entry, const std::string& table,
                     std::int64_t row, const std::string& digest, std::size_t& read);
    void find_strangers(Database& database);

    Link at_;
    bool strangers_ = true, done_ = false;
    std::vector<std::string> found_;
};

/// What the file has where another place says `link`; empty: the same.
[[nodiscard]] std::string differs_from(Database& database, const Link& link,
                                       const std::string& place);
/// Whether its newest entry is the one that its own head, of the same transaction, is signed for,
/// with this key (empty: with any). In words; empty: it is.
[[nodiscard]] std::string unsigned_end(Database& database, const std::string& public_key);

}  // namespace vibrig::journal
