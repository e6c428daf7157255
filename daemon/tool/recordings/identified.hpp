#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/dwells/anew.hpp"
#include "daemon/dwells/live.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "daemon/tool/analysis/spectrum_dwells.hpp"
#include "estimator/uncertainty/monte_carlo.hpp"

namespace vibrig::tool {

/// A dwell that a result is tried on.
using HeldOut = SpectrumResult::HeldOut;

/// What a recording gives: coefficients, and what can be believed of them.
struct Identified {
    estimator::Settings settings;
    estimator::Result result;
    estimator::uncertainty::Assessment assessed;
    bool simulated = false;                  ///< the rig was a program
    std::optional<CampaignNames> campaign;   ///< of a recorded one
    std::optional<dwells::Live> live;        ///< of a campaign that was identified anew at its end
    std::optional<SpectrumResult> spectrum;  ///< of rows enough, and of a campaign frequencies
    /// Dwells of a campaign planned for verification; all of a recording that is held out as a
    /// whole.
    std::vector<HeldOut> held_out;
};

/// How a recording's frequencies are to be taken.
struct SpectrumRequest {
    Spectra spectra;  ///< of dwells, where the recording does not say
    estimator::spectrum::Form form = estimator::spectrum::Form::automatic;
    /// The dwells are to prove a result, not to make one: what they cannot determine is not said.
    bool held_out = false;
};

/// Identifies FILE: a CSV recording, or a campaign (folder, HDF5 file or name). `config`: a TOML
/// file; empty: all defaults, or the campaign's own. Throws with file, line, key and value.
[[nodiscard]] Identified identify_recording(const std::string& file, const std::string& config,
                                            const SpectrumRequest& request = {});

/// JCGM 101 over it, with progress; throws when there is nothing to draw from.
[[nodiscard]] estimator::uncertainty::MonteCarlo draw(const Identified& of);

}  // namespace vibrig::tool
