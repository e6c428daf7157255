#pragma once

#include <string>
#include <vector>

#include "daemon/record/records.hpp"

namespace vibrig::record {

/// A recorded campaign in memory.
struct Campaign {
    std::string path;    ///< of the HDF5 file
    std::string folder;  ///< where it and its raw log are
    Head head;
    std::string state, reason;  ///< "running" when it was not closed
    std::int64_t ended_utc_ns = 0;
    std::string result_json;
    std::vector<drivers::Sample> samples;
    std::vector<Order> orders;
    std::vector<Dwell> dwells;
    std::vector<EstimateRow> estimates;
    std::vector<EventRecord> events;
    std::vector<Gap> gaps;
};

/// A dwell that was not cancelled before it began, with its samples.
struct RecordedDwell {
    const Order* order = nullptr;
    std::size_t first = 0, count = 0;  ///< in Campaign::samples
    bool cut_short = false;
};

/// The file that CAMPAIGN names: itself, or campaign.h5 in that folder (or in its only subfolder
/// that has one). Throws std::runtime_error with what was found and expected.
[[nodiscard]] std::string campaign_path(const std::string& argument);
/// Reads all of it, while it is being written too. Throws hdf5::Error or std::runtime_error.
[[nodiscard]] Campaign read_campaign(const std::string& argument);
/// HDF5 by its first bytes; false for what cannot be read.
[[nodiscard]] bool is_hdf5(const std::string& path);
[[nodiscard]] std::vector<RecordedDwell> recorded_dwells(const Campaign& campaign);
/// Of the effective configuration, the sections on which the identification depends,
/// and what a report states.
[[nodiscard]] std::string identification_sections(const std::string& configuration);
/// The raw log's files in order, compressed or not.
[[nodiscard]] std::vector<std::string> raw_files(const std::string& folder);

/// What mending did, and what is not there.
struct Recovery {
    bool was_closed = false;
    std::size_t samples = 0, dwells = 0;
    double recorded_s = 0;
    std::size_t rows_cut = 0;  ///< rows that were only half there
    std::size_t samples_from_raw = 0;
    double raw_until_s = 0;  ///< the raw log goes on so long after the last sample
    std::string cut_dwell;   ///< the dwell that was in progress; empty: none
    std::vector<std::string> words;
};

/// Makes a file whose writer died readable for every program again, takes what the raw log has
/// beyond it, and says what is lost. Does nothing to a closed file. Throws.
[[nodiscard]] Recovery recover(const std::string& argument);

}  // namespace vibrig::record
