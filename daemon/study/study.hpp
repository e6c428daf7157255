#pragma once

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/study/draws.hpp"

namespace vibrig::study {

/// "file:line:column: key: found X, expected Y", or what is wrong with a folder.
class StudyError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

inline constexpr std::uint64_t kMostTasks = 10'000'000;
inline constexpr std::int64_t kTrialsOfBlock = 10'000;  ///< JCGM 101, 7.9.4

/// A key with its value as TOML has it, and where it stands.
struct Setting {
    std::string key;    ///< "campaign.table_g", "rig.platform.slew_error_deg"
    std::string value;  ///< TOML on one line
    std::string place;  ///< "file:line:column"
};

/// A key of the rig: a value as JSON, or what its numbers are drawn from.
struct RigSetting {
    std::string key;   ///< "platform.slew_error_deg"
    std::string json;  ///< empty: drawn
    Distribution distribution;
    std::string place;
};

/// What is gone through, one value after the other.
struct Axis {
    std::string key;                  ///< as written: "campaign.table_g"
    std::vector<std::string> values;  ///< TOML on one line
    std::vector<Setting> settings;    ///< of the configuration, one for each value; or
    std::vector<RigSetting> rig;      ///< of the rig
};

/// A recorded campaign that is identified anew.
struct Recording {
    struct File {
        std::string path, sha256;
        std::uint64_t bytes = 0;
    };
    std::string folder;
    std::vector<File> files;  ///< its parts, in order
};

/// Which recordings of the folders.
struct Selection {
    std::string serial;  ///< of the unit; empty: any
    std::int64_t since_utc_ns = std::numeric_limits<std::int64_t>::min();
};

struct Study {
    std::string name, kind;  ///< "campaigns", "recordings" or "uncertainty"
    /// Runs of each point; how many recordings; blocks of trials.
    std::uint64_t seed = 1, runs = 1;
    std::string recording;             ///< whose uncertainty it is
    int digits = 1;                    ///< of u that are to hold
    std::vector<std::string> folders;  ///< where recordings are looked for
    Selection select;
    std::vector<Recording> recordings;   ///< planned; the study's file does not have them
    std::vector<Setting> configuration;  ///< [campaign] and [identify], for the daemon's own reader
    std::vector<RigSetting> rig;
    std::vector<Axis> grid;
    std::vector<std::string> warnings;  ///< what stands in the file without effect

    [[nodiscard]] std::uint64_t points() const;
    [[nodiscard]] std::uint64_t tasks() const { return points() * runs; }
    /// The place of each axis in its values; the first axis changes slowest.
    [[nodiscard]] std::vector<std::size_t> place_of(std::uint64_t point) const;
};

/// A STUDY.toml. Throws StudyError with all that is wrong, one per line.
[[nodiscard]] Study parse_study(const std::string& text, const std::string& name);

/// The configuration's text, one setting a line.
[[nodiscard]] std::string configuration_text(const std::vector<Setting>& settings);
/// Later ones replace earlier ones of the same key.
void put(std::vector<Setting>& settings, const Setting& setting);
/// A message of the daemon's reader about that text, with the places of the study's own file.
[[nodiscard]] std::string with_own_places(const std::string& message, const std::string& name,
                                          const std::vector<Setting>& settings);

}  // namespace vibrig::study
