#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::journal {

class Database;
class SigningKey;

/// An entry's number, from 1, and its hash: SHA-256 over the hash of the entry before it, the
/// table, the row's number and the SHA-256 of the row. 0: the beginning.
struct Link {
    std::int64_t entry = 0;
    std::string hash = std::string(32, '\0');
    bool operator==(const Link&) const = default;
};

/// Appends what was written to the chain, in the transaction that writes it. One thread.
class Chain {
  public:
    static void make_table(Database& database);
    /// The newest link of the file.
    [[nodiscard]] static Link newest(Database& database);

    explicit Chain(Link last) : last_(std::move(last)) {}
    /// A row as it is now: a new one, or one that was changed.
    void append(Database& database, std::string_view table, std::int64_t row);
    /// Every row of every table, as one found them. Returns how many.
    std::int64_t take_over(Database& database);
    [[nodiscard]] const Link& last() const noexcept { return last_; }
    void rewind(Link last) { last_ = std::move(last); }  ///< after a rollback

  private:
    Link last_;
};

/// The newest link as it was signed, kept in a file beside the journal. It may lag behind the
/// journal, after a power cut, and is never ahead of it.
struct SignedHead {
    Link link;
    std::string public_key, signature;  ///< hex
    [[nodiscard]] bool holds() const;
};
[[nodiscard]] SignedHead sign_head(const Link& link, const SigningKey& key);
/// Synced, then renamed. Empty, or why not.
[[nodiscard]] std::string write_head(const std::string& path, const SignedHead& head);
struct FoundHead {
    std::optional<SignedHead> head;
    std::string wrong;  ///< there is a file and it is no head; empty: fine, or no file
};
[[nodiscard]] FoundHead read_head(const std::string& path);

/// Walks over the chain and compares: hashes with each other, rows with what the chain has of them,
/// and at the end whether there are rows that it has not. A step at a time. What is missing or
/// changed is named.
class Verification {
  public:
    /// From the entry after `from`, which is believed.
    explicit Verification(Link from = {}) : at_(std::move(from)) {}
    /// So many entries, or bytes of rows, at most. Throws DatabaseError.
    void step(Database& database, std::int64_t entries, std::size_t bytes);
    [[nodiscard]] bool done() const noexcept { return done_; }
    [[nodiscard]] const Link& at() const noexcept { return at_; }
    /// In words; after the first kMostNamed they are counted only.
    [[nodiscard]] const std::vector<std::string>& found() const noexcept { return found_; }
    /// What the file has where another place, a signed head, says `link`; empty: the same.
    [[nodiscard]] static std::string compare(Database& database, const Link& link,
                                             const std::string& place);

    static constexpr std::size_t kMostNamed = 20;

  private:
    void name(std::string what);
    void find_strangers(Database& database);

    Link at_;
    bool done_ = false;
    std::vector<std::string> found_;
};

}  // namespace vibrig::journal
