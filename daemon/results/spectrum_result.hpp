#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/spectrum/analysis.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::tool {

/// A campaign over frequency, as results show it.
struct SpectrumResult {
    estimator::spectrum::Analysis analysis;
    estimator::spectrum::SpectralTable table;
    double reference_hz = 0;  ///< of the coefficients that are not static
    struct HeldOut {
        estimator::DwellRow row;
        estimator::spectrum::Kind kind;  ///< no bands: at rest; of a PSD of its own: its bands
    };
    std::vector<HeldOut> held_out = {};
    std::vector<estimator::spectrum::Sweep> sweeps = {};

    [[nodiscard]] bool several() const { return table.kinds().size() > 1 || !sweeps.empty(); }
};

/// Beyond it the covariances of all rates take too long.
inline constexpr std::size_t kMostSpectralDwells = 400;

/// "auto", "flat", "groups" or "resonance".
[[nodiscard]] estimator::spectrum::Form form_of(const std::string& name);

[[nodiscard]] SpectrumResult spectrum_of(const estimator::Settings& settings,
                                         std::vector<estimator::spectrum::SpectralDwell> dwells,
                                         std::vector<estimator::spectrum::Kind> kinds,
                                         estimator::spectrum::Form form,
                                         std::vector<estimator::spectrum::Sweep> sweeps = {});

/// The kinds of random vibration by their numbers in the controller.
using NumberedKinds = std::vector<std::pair<std::uint16_t, estimator::spectrum::Kind>>;

/// Bands at the platform of the random dwells whose PSD a controller reported, by
/// DwellRow::psd, from 1.
using PlayedBands = std::vector<std::vector<estimator::spectrum::Band>>;

/// Spectrum of a campaign's rows that say with which frequency they shook, or under which of
/// `profiles` (others are left out), those held out left aside; nothing where there are neither
/// several kinds nor a sweep, or too few or too many rows. Sweeps without a known second are left
/// out.
[[nodiscard]] std::optional<SpectrumResult> spectrum_of(
    const estimator::Settings& settings, const std::vector<estimator::DwellRow>& rows,
    estimator::spectrum::Form form = estimator::spectrum::Form::automatic,
    const NumberedKinds& profiles = {}, std::vector<estimator::spectrum::Sweep> sweeps = {},
    const PlayedBands& psds = {});

/// With several frequencies the assessment's coefficients become those of the analysis, its rates
/// those of all dwells, and its verdict hears of what does not fit. With one nothing changes.
void adopt(const SpectrumResult& spectrum, const estimator::Settings& settings,
           estimator::uncertainty::Assessment& assessed);

}  // namespace vibrig::tool
