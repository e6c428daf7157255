#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/dwells/anew.hpp"
#include "estimator/spectrum/analysis.hpp"
#include "estimator/spectrum/shaken.hpp"
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
    /// Quadratic coefficients were asked to be the same at all frequencies, and are not.
    bool compromise = false;

    /// Of one of the 30, order of parameter_names(): the frequency it is of, 0: static, or it knows
    /// none; NaN: a compromise belongs to none of them; Hz.
    [[nodiscard]] double at_hz(std::size_t parameter) const;
    /// Nothing says that the quadratic coefficients depend on the frequency.
    [[nodiscard]] bool same_at_all() const;
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

/// Spectrum of a campaign's rows that say with which frequency they shook, or under which of its
/// profiles (others are left out), those held out left aside; nothing where there are neither
/// several kinds nor a sweep, or too few or too many rows. Sweeps without a known second are left
/// out.
[[nodiscard]] std::optional<SpectrumResult> spectrum_of(
    const estimator::Settings& settings, const std::vector<estimator::DwellRow>& rows,
    estimator::spectrum::Shaken shaken,
    estimator::spectrum::Form form = estimator::spectrum::Form::automatic);

/// With several frequencies the assessment's coefficients become those of the analysis, its rates
/// those of all dwells, and its verdict hears of what does not fit. With one nothing changes.
void adopt(const SpectrumResult& spectrum, const estimator::Settings& settings,
           estimator::uncertainty::Assessment& assessed);

/// What can be believed of a campaign's result, and what it is over frequency. `found`: the noise
/// with which it was identified anew; `rows`: of all its dwells.
struct Assessed {
    estimator::uncertainty::Assessment assessed;
    std::optional<SpectrumResult> spectrum;
};
[[nodiscard]] Assessed assess(
    const estimator::Settings& settings, const std::optional<noise::Found>& found,
    const estimator::Result& result, const std::vector<estimator::DwellRow>& rows,
    estimator::spectrum::Shaken shaken,
    estimator::spectrum::Form form = estimator::spectrum::Form::automatic);

}  // namespace vibrig::tool
