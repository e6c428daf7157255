#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/spectrum/table.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

/// Lines of a vibration for runs and positions: Hz and g peak.
using Spectra = std::map<std::pair<int, int>, std::vector<std::pair<double, double>>>;
/// Reads `--spectra`: a JSON list of {"run", "position", "lines": [[hz, g_peak], ..]}; no lines:
/// rest. Throws with place, value and what was expected.
[[nodiscard]] Spectra read_spectra(const std::string& path);

/// What the dwells of a recording shook with, dwell by dwell.
class DwellKinds {
  public:
    DwellKinds(double configured_hz, const Spectra& spectra)
        : configured_hz_(configured_hz), spectra_(spectra) {}

    /// The next dwell, its rows not empty. Throws where the frequency changes within it.
    void add(const std::vector<const proto::RecordingRow*>& rows, const std::string& file);
    [[nodiscard]] const std::vector<estimator::spectrum::Kind>& kinds() const { return kinds_; }
    /// None: at rest, by what the recording says.
    [[nodiscard]] const std::optional<std::size_t>& of(std::size_t dwell) const {
        return of_dwell_[dwell];
    }
    /// The kind at the configured frequency, or else the most frequent one; none: nothing shakes.
    [[nodiscard]] std::optional<std::size_t> reference() const;

  private:
    [[nodiscard]] std::size_t kind_of(std::vector<estimator::spectrum::Band> bands);

    double configured_hz_;
    const Spectra& spectra_;
    std::vector<estimator::spectrum::Kind> kinds_;
    std::vector<std::optional<std::size_t>> of_dwell_;
};

}  // namespace vibrig::tool
