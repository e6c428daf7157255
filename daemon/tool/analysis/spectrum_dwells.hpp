#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "estimator/filter/measurement.hpp"
#include "estimator/spectrum/table.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

/// What a dwell shook with, as a file says it: lines (none: rest), or a profile.
struct StatedSpectrum {
    std::vector<std::pair<double, double>> lines;  ///< Hz and g peak
    std::string profile;                           ///< a name or a number; empty: lines
    std::vector<std::pair<double, double>> psd;    ///< of the profile, where it is stated here
    double level_db = 0;                           ///< about the profile
    std::string place = {};                        ///< in the file, before a key of it
};
/// For runs and positions.
using Spectra = std::map<std::pair<int, int>, StatedSpectrum>;
/// Reads `--spectra`: a JSON list of {"run", "position"} and "lines": [[hz, g_peak], ..] (none:
/// rest), or "profile": NAME|NUMBER or "psd": [[hz, g2_hz], ..] at the platform, with "level_db".
/// Throws with place, value and what was expected.
[[nodiscard]] Spectra read_spectra(const std::string& path);

/// What the dwells of a recording shook with, dwell by dwell.
class DwellKinds {
  public:
    /// `rig`: its profiles and what stands between table and platform; it has to outlive this.
    DwellKinds(const configuration::Configuration& rig, const Spectra& spectra)
        : configured_hz_(rig.estimator.frequency_hz), rig_(rig), spectra_(spectra) {}

    /// The next dwell, its rows not empty; `profiles`: those that the rows name. Throws where the
    /// frequency or the profile changes within it, and where a profile is not known.
    void add(const std::vector<const proto::RecordingRow*>& rows,
             const std::vector<std::string>& profiles, const std::string& file);
    /// Once it is known which dwells are at rest. Throws where the spectra list one that the
    /// recording has not while one that shook is not listed: it may be the one that was meant, and
    /// has the configuration's frequency. Of a recording that was cut short all are listed.
    void expect_listed(const std::string& file) const;
    [[nodiscard]] const std::vector<estimator::spectrum::Kind>& kinds() const { return kinds_; }
    /// None: at rest, by what the recording says.
    [[nodiscard]] const std::optional<std::size_t>& of(std::size_t dwell) const {
        return of_dwell_[dwell];
    }
    /// Who says so.
    enum class Said : unsigned char {
        stated,        ///< --spectra, or the name of a profile: it shook with that
        column,        ///< frequency_hz: a set-point, which may stand at rest, too
        configuration  ///< nobody: it may have been at rest
    };
    [[nodiscard]] Said said_by(std::size_t dwell) const { return said_[dwell]; }
    /// What the samples show of these dwells. A kind that no dwell is left of is gone.
    void put_at_rest(const std::vector<std::size_t>& dwells);
    /// Profile at the platform of a dwell under random vibration.
    [[nodiscard]] const estimator::RandomVibration& random(std::size_t dwell) const {
        return random_[dwell];
    }
    /// The sine at the configured frequency, or else the most frequent one; none: there is no sine.
    [[nodiscard]] std::optional<std::size_t> reference() const;

  private:
    [[nodiscard]] std::size_t kind_of(std::vector<estimator::spectrum::Band> bands);
    void add_random(const StatedSpectrum& of, const std::string& place);

    double configured_hz_;
    const configuration::Configuration& rig_;
    const Spectra& spectra_;
    std::vector<estimator::spectrum::Kind> kinds_;
    std::vector<std::optional<std::size_t>> of_dwell_;
    std::vector<estimator::RandomVibration> random_;
    std::vector<Said> said_;
    std::set<std::pair<int, int>> dwells_;  ///< runs and positions
};

}  // namespace vibrig::tool
