#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/archive/database.hpp"
#include "daemon/archive/entry.hpp"

namespace vibrig::archive {

/// What is asked for; what is empty or 0 selects nothing away.
struct Filter {
    std::string serial, type, rig, verdict, name;
    std::int64_t since_utc_ns = 0, until_utc_ns = 0;
    bool superseded = false;  ///< these too
    std::size_t newest = 0;   ///< at most so many, the newest; 0: all
};

/// A unit, and what there is of it.
struct Unit {
    std::string serial, type;
    std::int64_t campaigns = 0, last_utc_ns = 0;
    std::string verdict;  ///< of its newest campaign
};

/// Campaigns, their results and files, in SQLite or PostgreSQL. One thread; everything throws
/// ArchiveError.
class Index {
  public:
    Index(const std::string& where, Database::Mode mode) : database_(where, mode) {}

    /// Takes the place of what it had of this key. `files`: of the archive's own copies; otherwise
    /// those that the recorder noted stay.
    void put(const Entry& entry, bool files);
    void forget(const std::string& key);
    /// Of which vibration its quadratic coefficients are, where that is not noted yet.
    void note_vibration(const Entry& entry);
    /// The key of the campaign with this hash.
    [[nodiscard]] std::optional<std::string> key_of(const std::string& hash);
    /// Keys of the same rig's campaigns that began and ended when this one did, with other files:
    /// only one of them can be what was recorded.
    [[nodiscard]] std::vector<std::string> rivals_of(const Entry& entry);
    /// By their beginning; without coefficients and files.
    [[nodiscard]] std::vector<Entry> campaigns(const Filter& filter);
    /// The same with coefficients; `covariance`: these too.
    [[nodiscard]] std::vector<Entry> results(const Filter& filter, bool covariance = false);
    /// One with everything; nothing: there is none of that key.
    [[nodiscard]] std::optional<Entry> campaign(const std::string& key);
    /// Those with a campaign among the newest kOfNewest: of a million all of them are not looked
    /// at.
    static constexpr std::size_t kOfNewest = 2000;
    [[nodiscard]] std::vector<Unit> units();
    [[nodiscard]] std::vector<File> files(const std::string& key);
    /// Campaigns that a recorder noted as ended and nobody has read the result of.
    [[nodiscard]] std::vector<std::string> without_result();

    [[nodiscard]] const std::string& name() const noexcept { return database_.name(); }
    [[nodiscard]] Database& database() noexcept { return database_; }

  private:
    void put_rows(const Entry& entry);
    void remove_rows(const std::string& key);
    void put_files(const Entry& entry);
    void take_coefficients(const Filter& filter, std::map<std::string, Entry*>& by_key);

    Database database_;
};

/// The folder of recordings' own index.
[[nodiscard]] std::string index_in(const std::string& folder);

}  // namespace vibrig::archive
