#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace vibrig::proto {

/// One sample of a recording: what `vibrig identify` reads and the simulated rig writes.
struct RecordingRow {
    double time_s = 0;                  ///< grows within a run and position
    int run = 0;                        ///< from 1
    int position = 0;                   ///< from 1
    std::array<double, 3> angle_deg{};  ///< outer alpha, inner beta, azimuth gamma
    std::array<double, 3> force_g{};    ///< specific force, platform axes
    std::size_t line = 0;               ///< where the row stands in its file, from 1
    /// Of the vibration, 0 at rest; negative: the file has no such column.
    double frequency_hz = -1;
    /// Of random vibration: its place in RecordingReader::profiles, from 1; 0: none.
    std::uint16_t profile = 0;
    double level_db = 0;    ///< of it about its profile
    bool held_out = false;  ///< its dwell is to prove a result, not to be in it
};

/// A recording that cannot be read or written: "file:line: column X: found Y, expected Z".
class RecordingError : public std::runtime_error {
  public:
    /// Line 0: the file as a whole. Empty column: the line as a whole.
    RecordingError(const std::string& file, std::size_t line, const std::string& column,
                   const std::string& what);
};

/// Reads a CSV recording with the columns time_s, run, position, alpha_deg, beta_deg, gamma_deg,
/// ax_g, ay_g, az_g, and if it likes frequency_hz, profile, level_db and role, in any order and any
/// case, row by row in bounded memory; other columns are ignored unless they look like
/// frequency_hz, profile or simulated misspelt, and so are level_db without profile, and role where
/// there is neither frequency_hz nor profile and none of its words is "verify" or "identify", or
/// like them. The role "verify" holds a dwell out, "identify" or nothing does not. A profile is a
/// name or a number; 0 or nothing: the dwell was at rest or under a sine, and at rest where
/// frequency_hz is 0 or nothing, too. Fields are separated by commas, or by semicolons or tabs as
/// the header says; then numbers may have decimal commas. Lines of comment
/// (#) may come before the header. A (run, position) pair that comes back after another one begins
/// a new dwell. One that begins with the times and samples of another is a copy of it, and refused.
/// Throws RecordingError.
class RecordingReader {
  public:
    /// Reads the header.
    explicit RecordingReader(const std::string& path);
    ~RecordingReader();
    RecordingReader(const RecordingReader&) = delete;
    RecordingReader& operator=(const RecordingReader&) = delete;

    /// False at the end; no row at all is an error.
    bool next(RecordingRow& row);
    /// The header names the column `simulated`.
    [[nodiscard]] bool simulated() const;
    /// There is a column frequency_hz.
    [[nodiscard]] bool has_frequency() const;
    /// There is a column profile.
    [[nodiscard]] bool has_profile() const;
    /// As the rows have named them so far.
    [[nodiscard]] const std::vector<std::string>& profiles() const;
    [[nodiscard]] std::uint64_t bytes() const;  ///< read so far
    /// Of all rows: that the last one has no end of line. Told on standard error already.
    [[nodiscard]] const std::string& warning() const;

  private:
    class Rows;
    std::unique_ptr<Rows> rows_;
};

/// Writes what RecordingReader reads, every number with the digits that give it back exactly. Of a
/// simulated rig each row says so, in a last column `simulated`. The column frequency_hz is there
/// where the first row has one, profile and level_db where there are `profiles` (which
/// RecordingRow::profile counts), role where a dwell is held out. Throws RecordingError.
void write_recording(const std::string& path, std::span<const RecordingRow> rows,
                     bool simulated = false, std::span<const std::string> profiles = {});

}  // namespace vibrig::proto
