#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/domain/events.hpp"
#include "daemon/noise/found.hpp"
#include "daemon/record/index.hpp"
#include "daemon/record/records.hpp"

namespace vibrig::record {

/// One file of a campaign.
struct Part {
    std::string path, state;
    std::size_t samples = 0, dwells = 0;
};

/// A recorded campaign in memory. Times are those of the first part's clock.
struct Campaign {
    std::string path;  ///< of the first HDF5 file
    std::vector<Part> parts;
    std::string folder;  ///< where it and its raw log are
    Head head;
    std::string state, reason;  ///< "running" when it was not closed
    std::string mark;           ///< why it is marked; empty: it is not
    std::string incomplete;     ///< what is missing for its result; empty: nothing
    drivers::Time moved = 0;    ///< times of the newest part, to be those of the first one's clock
    std::size_t restarted_at = 0;  ///< dwells done when the daemon was last started
    std::int64_t ended_utc_ns = 0;
    std::string result_json;
    /// With what noise the result was identified anew; nothing: it is the live one.
    std::optional<noise::Found> found;
    std::vector<drivers::Sample> samples;
    std::vector<Order> orders;
    std::vector<Dwell> dwells;
    std::vector<SweptRow> swept;
    std::vector<Played> played;  ///< in the orders, too, once those are there
    std::vector<EstimateRow> estimates;
    std::vector<ConditionRow> conditions;  ///< none in recordings of vibrigd 0.1.0
    std::vector<EventRecord> events;
    std::vector<Gap> gaps;
};

/// Into the orders what was played in them, PSDs that were reported numbered from 1.
void place_played(Campaign& campaign);

/// A dwell that was not cancelled before it began, with its samples.
struct RecordedDwell {
    const Order* order = nullptr;
    std::size_t first = 0, count = 0;  ///< in Campaign::samples
    bool cut_short = false;
};

/// The state of a file after which the campaign goes on in the next one.
inline constexpr const char* kContinued = "continued";
/// "campaign.h5", "campaign-2.h5" ...
[[nodiscard]] std::string part_name(int part);
/// It is called as that part is. A file of another name, put aside by somebody, stands for itself.
[[nodiscard]] bool is_part_file(const std::string& path, int part);
[[nodiscard]] std::string folder_of(const std::string& path);
/// The last name of a path, that of a folder with a slash behind it too.
[[nodiscard]] std::string base_name(const std::string& path);
/// The files in a folder that are called so, by their numbers.
[[nodiscard]] std::map<int, std::string> part_files(const std::string& folder);
/// The first file that CAMPAIGN names: itself, or campaign.h5 in that folder (or in its only
/// subfolder that has one). Throws std::runtime_error with what was found and expected.
[[nodiscard]] std::string campaign_path(const std::string& argument);
/// Reads all parts of it, while it is being written too: what came again after a restart takes the
/// place of what was not finished before. Throws hdf5::Error or std::runtime_error; a part that is
/// missing is named.
[[nodiscard]] Campaign read_campaign(const std::string& argument);
/// One file alone.
[[nodiscard]] Campaign read_part(const std::string& path);
/// Without its tables.
[[nodiscard]] Campaign read_part_head(const std::string& path);
/// Without its samples, but with the conditions around them and the number of its dwells.
[[nodiscard]] Campaign read_part_around(const std::string& path);
/// Times of the first and the last sample of a file, and how many there are.
struct Span {
    drivers::Time first = 0, last = 0;
    std::size_t samples = 0;
};
[[nodiscard]] Span part_span(const std::string& path);
/// The last part of the newest campaign in `folder` that `head` goes on with: of the same name and
/// configuration and not finished; without its tables.
[[nodiscard]] std::optional<Campaign> interrupted_campaign(const std::string& folder,
                                                           const Head& head);
/// Makes a part whose writer died readable for every program; nothing if it is closed. Throws.
void close_part(const std::string& path, const std::string& next);
/// `what` about a campaign's file that cannot be read, with how to do without it if its raw log is
/// there.
[[nodiscard]] std::string with_raw_log(std::string what, const std::string& path);
/// HDF5 by its first bytes; false for what cannot be read.
[[nodiscard]] bool is_hdf5(const std::string& path);
/// Good, and numbers: a file may say so of what is none.
[[nodiscard]] bool angles_known(const drivers::Sample& sample);
[[nodiscard]] bool force_known(const drivers::Sample& sample);
[[nodiscard]] std::vector<RecordedDwell> recorded_dwells(const Campaign& campaign);
/// That of a rig that is a program, by its effective configuration.
[[nodiscard]] bool of_simulated_rig(const std::string& configuration);
/// The sections of the effective configuration on which the identification depends,
/// and what a report states.
[[nodiscard]] std::string identification_sections(const std::string& configuration);
/// The raw log's files in order, compressed or not.
[[nodiscard]] std::vector<std::string> raw_files(const std::string& folder);
/// Names of those in the folder that are not among `logs`, by their numbers.
[[nodiscard]] std::vector<std::string> left_out(const std::string& folder,
                                                const std::vector<std::string>& logs);
/// Number of raw-0003.log, compressed or not: 3; 0 for other names.
[[nodiscard]] int raw_number(const std::string& path);
/// Logs in the order in which they are read: segments of one folder by their numbers, each once
/// where both it and its compressed one are given; others as they are given. Throws
/// std::runtime_error if one is given twice.
[[nodiscard]] std::vector<std::string> in_order(std::vector<std::string> logs);

/// What mending did, and what is not there.
struct Recovery {
    std::string path;  ///< of the campaign's first file
    std::string
        failed;  ///< why it could not be recovered, and nothing else is known; empty: it was
    bool was_closed = false;
    bool recovered = false;  ///< its writer died, and it was mended now or before
    std::size_t samples = 0, dwells = 0;
    double recorded_s = 0;
    std::int64_t ends_utc_ns = 0;  ///< of the last sample; 0: there is none
    std::size_t parts = 1;
    std::size_t samples_from_raw = 0;
    double raw_until_s = 0;     ///< the raw log goes on so long after the file's last sample
    std::uint64_t missing = 0;  ///< sync counts that are not there between the first and the last
    std::string cut_dwell;      ///< the dwell that was in progress; empty: none
    std::vector<std::string> words;
    std::vector<std::string> missing_raw;  ///< segments of the raw log that are not there
    std::string misplaced_raw;             ///< one that does not belong where it is; empty: none
};

/// Makes the files of a campaign whose writer died readable for every program again, takes what the
/// raw log has beyond them, and says what is lost. Does nothing to closed files. Of a folder with
/// several campaigns all, each on its own, and its index is made anew. Throws, of one campaign.
[[nodiscard]] std::vector<Recovery> recover(const std::string& argument, const Index::Tell& tell);

}  // namespace vibrig::record
