#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::journal {

class SigningKey;

/// An entry's number, from 1, and its hash: SHA-256 over the hash of the entry before it, the
/// table, the row's number and the SHA-256 of the row. 0: the beginning.
struct Link {
    std::int64_t entry = 0;
    std::string hash = std::string(32, '\0');
    bool operator==(const Link&) const = default;
};

/// A journal's newest entry, or another one of it, as its daemon has signed it. One line of text,
/// the same in the journal, beside it, in recordings, in reports and in the status:
/// "vibrig-journal-head/1 chain=.. entry=.. hash=.. utc_ns=.. key=.. signature=..".
struct SignedHead {
    std::string chain;  ///< hash of its entry 1, hex: which journal; empty: it has none yet
    Link link;
    std::int64_t utc_ns = 0;
    std::string public_key, signature;  ///< hex

    /// By its own key; whose that is others have to know.
    [[nodiscard]] bool holds() const;
    [[nodiscard]] std::string line() const;
    /// As far as it is signed.
    [[nodiscard]] std::string signed_text() const;
};

/// Where a head is kept, or was found.
struct Anchor {
    std::string place;  ///< in words
    SignedHead head;
};

inline constexpr std::string_view kHeadWord = "vibrig-journal-head/";

[[nodiscard]] SignedHead sign_head(std::string chain, const Link& link, std::int64_t utc_ns,
                                   const SigningKey& key);
/// Nothing: it is no such line. Whether it holds is another question.
[[nodiscard]] std::optional<SignedHead> parse_head(std::string_view line);
/// Every head that stands in a text, a report's page for example.
[[nodiscard]] std::vector<SignedHead> heads_in(std::string_view text);

/// Synced, then renamed. Empty, or why not.
[[nodiscard]] std::string write_head(const std::string& path, const SignedHead& head);
struct FoundHead {
    std::optional<SignedHead> head;
    std::string wrong;  ///< there is a file and it is no head; empty: fine, or no file
};
[[nodiscard]] FoundHead read_head(const std::string& path);

/// ns since 1970.
[[nodiscard]] std::int64_t utc_now();

/// "SHA256:" and the first 16 hexadecimal digits: short enough to be compared by eye.
[[nodiscard]] std::string fingerprint(const std::string& public_key);

}  // namespace vibrig::journal
