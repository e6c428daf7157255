#pragma once

#include <string>
#include <vector>

namespace vibrig::configuration {

/// [record]
struct RecordSettings {
    bool enabled = true;
    std::string folder;  ///< a folder for each campaign goes here; empty: campaign.results
    bool raw = true;     ///< frames too, as candump logs
    double segment_s = 600;
    int segment_mb = 64;
    bool zstd = true;       ///< closed segments are compressed
    double flush_s = 0.5;   ///< a second with what the disk and the thread add
    int keep_free_mb = 64;  ///< with less on the disk nothing is written
};

/// [[instrument]]: what is measured with.
struct Instrument {
    std::string name, serial, certificate;
    std::string uncertainty;  ///< as its certificate has it, with k
    std::string due;          ///< YYYY-MM-DD; empty: not stated
    /// On a day written the same way.
    [[nodiscard]] bool overdue(const std::string& day) const { return !due.empty() && due < day; }
};

/// [unit] and [[instrument]]: what stands in a report and changes no result.
struct Paperwork {
    std::string unit_type, unit_serial;
    std::vector<Instrument> instruments;
};

}  // namespace vibrig::configuration
