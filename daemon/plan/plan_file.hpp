#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace vibrig::plan {

/// "file:line: column: found X, expected Y", or the place in a JSON file.
class PlanFileError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

struct PlannedRun {
    std::array<double, 3> position_deg{};  ///< gimbal angles: outer, inner, azimuth
    double level_g = 0;                    ///< peak at the platform
    double table_g = 0;                    ///< peak at the table: the shaker's set-point
    std::size_t count = 1;
    double frequency_hz = 0;  ///< 0: the configuration's
    bool verify = false;      ///< role "verify": held out of the fit
    /// Random vibration: name or number of a profile, at this level about it; the levels in g are
    /// 0 then. Empty: a sine.
    std::string profile{};
    double level_db = 0;
    std::string profile_place{};  ///< of the profile or the sweep, in the file
    /// A sine that goes from one frequency to the other, exponentially; 0: it stands.
    double sweep_from_hz = 0, sweep_to_hz = 0, sweep_s = 0;
};

/// Platform over table; of a frequency, or, for none, of the configuration's. None: not known.
using TransmissionAt = std::function<std::optional<double>(std::optional<double> hz)>;

struct PlanFile {
    std::vector<PlannedRun> runs;
    std::optional<double> dwell_s;  ///< that its forecast was made for; a run has none of its own
    std::string warning{};          ///< of NumberTable
};

/// Reads what `vibrig plan --json` prints ("runs" with position, level_g, table_g, count; other
/// keys and columns are ignored, but for those that look like a misspelt one or are the campaign's,
/// dwell_s, settle_s and ramp_s of a run: these are refused), or CSV with
/// the columns alpha_deg, beta_deg, gamma_deg, level_g or table_g, and count if not 1; and per run
/// frequency_hz, and role "identify" or "verify", and `profile` with level_db in place of frequency
/// and levels, which are empty or 0 in CSV then, or `sweep` {from_hz, to_hz, s} (CSV:
/// sweep_from_hz, sweep_to_hz, sweep_s) in place of the frequency. Where one level is missing,
/// `transmission` (platform over table) gives it; where both are there and disagree by more than 1
/// %, the file is refused; so is JSON that states another transmission than the configuration's, or
/// another frequency than `rig_hz` where runs shake at the configuration's. Throws PlanFileError.
[[nodiscard]] PlanFile read_plan_file(const std::string& path, const TransmissionAt& transmission,
                                      std::optional<double> rig_hz = std::nullopt);

/// What stands between table and platform by the plan's own words.
struct PlanMount {
    double transmission = 1;  ///< 1 and more: hard
    double at_hz = 0;         ///< 0: the configuration's
};
/// As `vibrig plan --json` says it; none: the file does not, as no CSV does.
[[nodiscard]] std::optional<PlanMount> read_plan_mount(const std::string& path);

/// Where a plan's rows are judged: a profile's levels in g are 0, as at rest. Throws PlanFileError.
void refuse_random(const std::vector<PlannedRun>& runs);

/// CSV with the columns alpha_deg, beta_deg, gamma_deg. Throws PlanFileError. The table's warning,
/// if there is one, goes to the end of `warnings`.
[[nodiscard]] std::vector<std::array<double, 3>> read_positions(const std::string& path,
                                                                std::vector<std::string>& warnings);

}  // namespace vibrig::plan
