#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/journal/chain.hpp"
#include "daemon/journal/database.hpp"
#include "daemon/journal/signing_key.hpp"

namespace vibrig::journal {

/// Beside the journal.
inline constexpr const char* kHeadSuffix = ".head";
inline constexpr const char* kKeySuffix = ".key";

/// The journal's file with its chain, its signed head and the key: whether it is what was written
/// into it. Verified a slice at a time, so that nobody waits for a large one. One thread; what
/// reads or writes throws DatabaseError.
class ChainedFile {
  public:
    struct Pace {
        std::int64_t entries = 2000;      ///< of a slice
        std::size_t bytes = 8 << 20;      ///< of rows in a slice
        std::int64_t period_ns = 60'000'000'000;  ///< between slices once all was verified
    };
    using Salvage = std::function<void(Database&)>;

    /// Opens or makes it. If something is missing or changed, `salvage` takes what it can from it
    /// before it is put aside and a new one is begun; found() says why.
    ChainedFile(std::string path, Pace pace, const Salvage& salvage);

    [[nodiscard]] Database& database();
    [[nodiscard]] const std::vector<std::string>& found() const noexcept { return found_; }
    /// Where what was found fault with is now; how the chain begins, if it began with this start.
    [[nodiscard]] const std::string& aside() const noexcept { return aside_; }
    [[nodiscard]] const std::string& begins() const noexcept { return begins_; }

    void begin();
    void chained(std::string_view table, std::int64_t row) {
        chain_.append(database(), table, row);
    }
    /// Then the head is signed; a head that lags is no fault.
    void commit();
    void roll_back() noexcept;

    /// Looks at it; CLOCK_MONOTONIC. What is missing or changed since, in words.
    [[nodiscard]] std::vector<std::string> look(std::int64_t now_ns);
    /// Puts it aside, as at the beginning, and begins a new one.
    void replace(std::vector<std::string> found);
    /// All of it, since this start.
    [[nodiscard]] bool verified() const noexcept { return verified_; }

    [[nodiscard]] const Link& head() const noexcept { return chain_.last(); }
    [[nodiscard]] std::string public_key() const { return key_ ? key_->public_key() : ""; }

    static constexpr std::int64_t kVersion = 2;

  private:
    struct Identity {
        dev_t device = 0;
        ino_t node = 0;
        off_t size = -1;  ///< -1: there is none
    };
    [[nodiscard]] static Identity identity_of(const std::string& path);

    [[nodiscard]] std::vector<std::string> open(bool anew);
    void make(std::int64_t version, const std::string& origin);
    void take_key(std::vector<std::string>& found);
    void check_start(const FoundHead& beside, std::vector<std::string>& found);
    void put_aside();
    [[nodiscard]] std::string gone() const;
    void note_identity();

    const std::string path_;
    const Pace pace_;
    std::unique_ptr<Database> database_;
    std::optional<SigningKey> key_;
    Chain chain_{Link{}};
    Link before_;  ///< the transaction in progress
    std::vector<std::string> found_;
    std::string aside_, begins_;
    Identity file_, log_;
    std::int64_t data_version_ = 0;
    bool verified_ = false;
    std::optional<Verification> pass_;
    std::int64_t next_slice_ns_ = 0;
};

}  // namespace vibrig::journal
