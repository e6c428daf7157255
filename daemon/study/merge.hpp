#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/study/folder.hpp"

namespace vibrig::study {

/// What parts lack or have too much of.
struct MergeFindings {
    /// [first, last] of what no part has, or what two parts have differently.
    std::vector<std::pair<std::uint64_t, std::uint64_t>> missing;
    std::uint64_t missing_count = 0, duplicates = 0;
    /// One line each. Damage is named even where another part has what was lost.
    std::vector<std::string> damaged;
    /// Torn at its end, of a process that was killed or still writes: that is no damage.
    std::vector<std::string> unfinished;
    std::vector<std::string> foreign, contradictions;
};

/// The records of all parts in the order of their index, each once. Few files are open at a time,
/// and memory does not grow with the number of tasks.
class Merged {
  public:
    explicit Merged(const Folder& folder);
    ~Merged();

    bool next(TaskRecord& record);

    /// Whole after the last record.
    [[nodiscard]] const MergeFindings& found() const { return found_; }
    /// Whether all that there is of a part was read.
    [[nodiscard]] bool read_to_its_end(const std::string& file) const {
        return read_.contains(file);
    }

  private:
    struct Source;
    void begin_until(std::uint64_t index);
    bool advance(Source& source);
    void miss(std::uint64_t from, std::uint64_t to);

    const Folder& folder_;
    std::deque<std::pair<std::uint64_t, PartName>> waiting_;  ///< first index
    std::vector<std::unique_ptr<Source>> open_;
    std::uint64_t expected_ = 0;
    MergeFindings found_;
    std::set<std::string> read_;
};

struct Compaction {
    std::size_t parts = 0;          ///< that became one and are gone
    std::vector<std::string> kept;  ///< one line for each that stays, and why
    std::string refused;            ///< why nothing was done; empty: it was
};

/// All closed parts become one, with what abandoned ones hold; nothing is removed that was not read
/// to its end. Where something is contradictory or foreign nothing is done. Throws StudyError when
/// the new part cannot be written.
Compaction compact(const Folder& folder);

}  // namespace vibrig::study
