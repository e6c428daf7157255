#include <iostream>
#include <optional>
#include <string>

#include "daemon/report/result_charts.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/results/result_table.hpp"
#include "daemon/results/spectrum_text.hpp"
#include "daemon/tool/analysis/spectrum_dwells.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/identified.hpp"
#include "daemon/tool/simulated.hpp"
#include "estimator/filter/instruction_set.hpp"

namespace vibrig::tool {

namespace {

struct IdentifyOptions {
    std::string recording;
    std::string config;
    std::string plot;
    std::string instruction_set = "auto";
    bool json = false;
    bool strict = false;
    bool monte_carlo = false;
    std::string spectra;
    std::string spectrum = "auto";
};

/// What it throws names file, line, key and value already.
int run(const IdentifyOptions& options) {
    estimator::use_instruction_set(options.instruction_set);
    SpectrumRequest request;
    request.form = form_of(options.spectrum);
    if (!options.spectra.empty()) request.spectra = read_spectra(options.spectra);
    const Identified identified = identify_recording(options.recording, options.config, request);
    const auto& assessed = identified.assessed;
    const auto* spectrum = identified.spectrum ? &*identified.spectrum : nullptr;
    if (!options.plot.empty())
        report::plot_result(options.plot, identified.result, assessed, identified.simulated);
    std::optional<estimator::uncertainty::MonteCarlo> drawn;
    if (options.monte_carlo) drawn = draw(identified);
    const auto* check = drawn ? &*drawn : nullptr;
    const auto* campaign = identified.campaign ? &*identified.campaign : nullptr;
    const auto* live = identified.live ? &*identified.live : nullptr;
    std::cout << (options.json ? result_json(identified.result, assessed, identified.simulated,
                                             check, live, spectrum, nullptr, campaign) +
                                     "\n"
                               : simulated_line(identified.simulated) +
                                     result_table(identified.result, assessed) +
                                     (spectrum != nullptr ? spectrum_text(*spectrum) : "") +
                                     (check != nullptr ? monte_carlo_text(*check) : ""))
              << std::flush;
    return exit_status(assessed.verdict.level, options.strict);
}

}  // namespace

void add_identify(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<IdentifyOptions>(
        app, exit_code, "identify",
        "Gyro error coefficients from a recording (CSV, or HDF5 of vibrigd)", run);
    command
        .add_option("FILE", options.recording,
                    "CSV with a header row and the columns time_s, run, position, alpha_deg, "
                    "beta_deg, gamma_deg, ax_g, ay_g, az_g in any order; or a recorded "
                    "campaign: its folder, HDF5 file or name")
        ->required();
    command.add_option(
        "--config", options.config,
        "configuration file (TOML); without it all defaults apply, of an HDF5 file its "
        "own");
    command
        .add_option("--instruction-set", options.instruction_set,
                    "of the filter: auto (the best), or one of this processor's")
        ->envname("VIBRIG_INSTRUCTION_SET");
    command
        .add_option("--plot", options.plot,
                    "an SVG file: uncertainties of the coefficients; or a folder: their "
                    "correlation and the dwells' residuals, too")
        ->check(proto::charts());
    command.add_flag("--json", options.json, "print the result as JSON");
    command
        .add_option(
            "--spectrum", options.spectrum,
            "quadratic coefficients over frequency, where a recording has several "
            "(columns frequency_hz, profile): flat, groups, resonance, or auto, which weighs them")
        ->check(CLI::IsMember({"auto", "flat", "groups", "resonance"}));
    command.add_option(
        "--spectra", options.spectra,
        "JSON list of {run, position, lines: [[hz, g_peak], ..]}, or in place of lines "
        "profile or psd, and level_db, for a recording without the columns");
    command.add_flag("--strict", options.strict, "a doubtful result is a no as well");
    command.add_flag("--monte-carlo", options.monte_carlo,
                     "draw the declared inputs (JCGM 101) to check the combined uncertainty");
    command.footer(
        "Example: vibrig identify recording.csv --config rig.toml --plot pictures --json > "
        "result.json\n"
        "Exit codes: 0 the result is valid or doubtful (the verdict says why), 1 it is not valid, "
        "the configuration does not\nfit the recording (the warnings name what contradicts, and "
        "the keys suspected), or\ncoefficients are not observable (the result names them and the "
        "combinations that are "
        "determined),\nwith --strict also when it is doubtful; 2 bad usage or input.");
}

}  // namespace vibrig::tool
