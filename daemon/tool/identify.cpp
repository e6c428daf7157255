#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/tool/campaign_argument.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/exit_status.hpp"
#include "daemon/tool/identified.hpp"
#include "daemon/tool/progress.hpp"
#include "daemon/tool/result_json.hpp"
#include "daemon/tool/result_table.hpp"
#include "daemon/tool/rig_doubts.hpp"
#include "daemon/tool/simulated.hpp"
#include "daemon/tool/spectrum_dwells.hpp"
#include "daemon/tool/spectrum_result.hpp"
#include "estimator/hann.hpp"
#include "estimator/identification.hpp"
#include "estimator/instruction_set.hpp"
#include "estimator/kinematics.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/plan_report.hpp"
#include "estimator/vibration_level.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

namespace {

using proto::RecordingRow;

struct Dwell {
    int run = 0;
    int position = 0;
    std::vector<const RecordingRow*> rows;
};

/// One dwell for each stretch of rows with the same run and position: a pair that comes back
/// begins another.
std::vector<Dwell> dwells_of(const std::vector<RecordingRow>& rows) {
    std::vector<Dwell> dwells;
    for (const RecordingRow& row : rows) {
        if (dwells.empty() || dwells.back().run != row.run ||
            dwells.back().position != row.position)
            dwells.push_back({row.run, row.position, {}});
        dwells.back().rows.push_back(&row);
    }
    return dwells;
}

/// The times of the file go on from dwell to dwell.
bool has_common_clock(const std::vector<Dwell>& dwells) {
    for (std::size_t d = 1; d < dwells.size(); ++d) {
        if (!(dwells[d].rows.front()->time_s > dwells[d - 1].rows.back()->time_s)) return false;
    }
    return true;
}

estimator::Measurement measurement_of(const RecordingRow& row) {
    estimator::Measurement measurement;
    measurement.time_s = row.time_s;
    for (std::size_t i = 0; i < 3; ++i) {
        measurement.angle_rad[i] = row.angle_deg[i] * (std::numbers::pi / 180);
        measurement.force_g[i] = row.force_g[i];
    }
    return measurement;
}

/// A dwell as a plan would have it: where it begins, and its level by its own accelerometers.
class SeenDwell {
  public:
    explicit SeenDwell(const estimator::Settings& settings) : settings_(settings) {}

    void add(const estimator::Measurement& measurement) {
        if (!begin_s_) begin_s_ = measurement.time_s;
        end_s_ = measurement.time_s;
        if (times_s_.size() < kTimesEnough) times_s_.push_back(end_s_);
        std::array<double, 3> angle_deg{};
        double all = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            angle_deg[i] = measurement.angle_rad[i] * (180 / std::numbers::pi);
            all += angle_deg[i] + measurement.force_g[i];
        }
        const bool good = measurement.angles_good && measurement.force_good;
        if (!good || !std::isfinite(all)) return;
        if (!up_) {
            angles_deg_ = estimator::gimbal_deg(settings_, angle_deg);
            up_ = estimator::plan::up_at(settings_, angle_deg);
        }
        double along = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j) {
                along += (*up_)[i] * settings_.accelerometer_matrix[i][j] *
                         (measurement.force_g[j] - settings_.accelerometer_zero_g[j]);
            }
        }
        force_.add(along);
    }

    /// Nothing without a good sample.
    [[nodiscard]] std::optional<estimator::PlannedDwell> planned() const {
        if (!up_) return std::nullopt;
        const auto means = force_.means();
        double kappa = means.mean_square / (means.mean * means.mean) -
                       settings_.accelerometer_g * settings_.accelerometer_g;
        if (kappa - 1 < 1e-4) kappa = 1;  // at rest
        const double duration_s = end_s_ - *begin_s_;
        if (!(duration_s > 0) || !std::isfinite(kappa)) return std::nullopt;
        return estimator::PlannedDwell{angles_deg_, kappa, duration_s, 1};
    }

    /// Between its samples, s; 0: not known. Once.
    [[nodiscard]] double period_s() { return estimator::median_interval(times_s_); }

  private:
    static constexpr std::size_t kTimesEnough = 1001;

    const estimator::Settings& settings_;
    std::vector<double> times_s_;
    std::optional<double> begin_s_;
    double end_s_ = 0;
    std::array<double, 3> angles_deg_{};
    std::optional<std::array<double, 3>> up_;
    estimator::GrowingHann force_;
};

int run_of(const Dwell& dwell) { return dwell.run; }
int run_of(const record::RecordedDwell& dwell) { return dwell.order->run; }

/// Says what these dwells cannot determine, before they are gone through. `show(dwell, seen)` adds
/// all measurements of a dwell to `seen`.
template <typename Dwells, typename Show>
void tell_before(const Dwells& dwells, const estimator::Settings& settings, const Show& show) {
    std::vector<estimator::PlannedDwell> plan;
    double period_s = 0;
    for (const auto& dwell : dwells) {
        SeenDwell seen(settings);
        show(dwell, seen);
        if (!(period_s > 0)) period_s = seen.period_s();
        if (auto one = seen.planned()) {
            one->run = run_of(dwell);
            plan.push_back(*one);
        }
    }
    if (plan.empty() || !(period_s > 0)) return;
    for (const std::string& line :
         estimator::plan_warnings(estimator::report_plan(settings, plan, period_s))) {
        std::cerr << "before the run: " << line << '\n';
    }
    const bool vibrating =
        std::any_of(plan.begin(), plan.end(), [](const auto& one) { return one.kappa > 1; });
    const std::string alias = estimator::VibrationLevel::aliasing(settings.frequency_hz, period_s,
                                                                  settings.level_window_s);
    if (vibrating && !alias.empty()) std::cerr << "before the run: " << alias << '\n';
}

/// A result, and what of the recording contradicts the configuration.
struct Found {
    estimator::Result result;
    std::string contradiction;  ///< the first; empty: none
    std::vector<estimator::spectrum::SpectralDwell> spectral;
    std::vector<estimator::spectrum::Kind> kinds;
};

Found with_doubts(estimator::Result result, const RigDoubts& doubts) {
    Found found;
    found.result = std::move(result);
    found.contradiction = doubts.tell(found.result);
    return found;
}

DwellKinds kinds_of(const std::vector<Dwell>& dwells, const estimator::Settings& settings,
                    const SpectrumRequest& request, const std::string& file) {
    DwellKinds kinds(settings.frequency_hz, request.spectra);
    for (const Dwell& dwell : dwells) kinds.add(dwell.rows, file);
    return kinds;
}

/// What a dwell at another frequency than the filter's says: by a filter of its own, so that the
/// coefficients at the reference frequency take nothing of it.
void add_apart(estimator::Identification& apart, estimator::Result& to) {
    estimator::Result one = apart.result();
    to.samples += one.samples;
    to.rejected += one.rejected;
    std::move(one.dwells.begin(), one.dwells.end(), std::back_inserter(to.dwells));
}

Found identify(const std::vector<RecordingRow>& rows, estimator::Settings settings,
               const SpectrumRequest& request, const std::string& file) {
    const std::vector<Dwell> dwells = dwells_of(rows);
    const DwellKinds kinds = kinds_of(dwells, settings, request, file);
    const auto reference = kinds.reference();
    if (reference) settings.frequency_hz = kinds.kinds()[*reference].hz();
    tell_before(dwells, settings, [](const Dwell& dwell, SeenDwell& seen) {
        for (const RecordingRow* row : dwell.rows) seen.add(measurement_of(*row));
    });
    const bool common_clock = has_common_clock(dwells);
    estimator::Identification identification(settings, dwells.size());
    RigDoubts doubts(settings);
    Progress progress("identifying");
    std::size_t done = 0;
    Found found;
    found.kinds = kinds.kinds();
    estimator::Result others;
    for (std::size_t d = 0; d < dwells.size(); ++d) {
        const Dwell& dwell = dwells[d];
        const auto kind = kinds.of(d);
        std::optional<estimator::Identification> apart;
        if (kind && kind != reference) {
            estimator::Settings own = settings;
            own.frequency_hz = kinds.kinds()[*kind].hz();
            apart.emplace(own, 1);
        }
        estimator::Identification& filter = apart ? *apart : identification;
        const std::size_t before = filter.rows().size();
        estimator::DwellInfo info{dwell.run, dwell.position};
        if (common_clock) info.begin_s = 0;
        filter.begin_dwell(info);
        doubts.begin_dwell();
        for (const RecordingRow* row : dwell.rows) {
            const auto measurement = measurement_of(*row);
            static_cast<void>(filter.add(measurement));
            doubts.add(measurement);
            // Asking a clock costs more than a filter step.
            if (++done % 1024 == 0) {
                progress.show(done, rows.size());
            }
        }
        static_cast<void>(filter.end_dwell());
        if (filter.rows().size() > before) {
            const estimator::DwellRow& row = filter.rows().back();
            const bool shook = row.vibration.kappa > 1;
            if (shook && !kind)
                throw std::runtime_error(file + ":" + std::to_string(dwell.rows.front()->line) +
                                         ": found a dwell at rest that vibrates by " +
                                         std::to_string(std::sqrt(2 * (row.vibration.kappa - 1))) +
                                         " g, expected its frequency");
            found.spectral.push_back({row, shook ? kind : std::nullopt, 0});
        }
        if (apart) add_apart(*apart, others);
    }
    Found whole = with_doubts(identification.result(), doubts);
    found.result = std::move(whole.result);
    found.contradiction = std::move(whole.contradiction);
    found.result.samples += others.samples;
    found.result.rejected += others.rejected;
    std::move(others.dwells.begin(), others.dwells.end(), std::back_inserter(found.result.dwells));
    return found;
}

/// Of a campaign's HDF5 file the dwells as they were fed, with the levels commanded.
Found identify(const record::Campaign& campaign, const estimator::Settings& settings) {
    const auto dwells = record::recorded_dwells(campaign);
    tell_before(dwells, settings, [&](const record::RecordedDwell& dwell, SeenDwell& seen) {
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i)
            seen.add(
                rt::measurement_of(campaign.samples[i], dwell.order->from, dwell.order->zero_g));
    });
    std::optional<dwells::Anew> anew;
    if (campaign.found) anew.emplace(settings, *campaign.found, dwells.size());
    estimator::Identification as_recorded(settings, dwells.size());
    auto& identification = anew ? anew->identification() : as_recorded;
    RigDoubts doubts(settings);
    Progress progress("identifying");
    std::size_t done = 0;
    for (const auto& dwell : dwells) {
        doubts.begin_dwell();
        record::feed(identification, campaign, dwell,
                     [&](std::size_t sample, const estimator::StepResult&) {
                         doubts.add(rt::measurement_of(campaign.samples[sample], dwell.order->from,
                                                       dwell.order->zero_g));
                         if (++done % 1024 == 0) progress.show(done, campaign.samples.size());
                     });
    }
    return with_doubts(anew ? anew->result() : identification.result(), doubts);
}

Found identify_campaign(const std::string& path, const std::string& config,
                        estimator::Settings& settings, bool& simulated,
                        std::optional<dwells::Live>& live) {
    record::Campaign campaign = read_named_campaign(path);
    if (!campaign.incomplete.empty()) throw std::runtime_error(campaign.incomplete);
    if (!config.empty()) record::forget_noise(campaign);
    const auto loaded =
        config.empty()
            ? configuration::parse(record::identification_sections(campaign.head.configuration),
                                   "configuration in " + campaign.path, false)
            : configuration::load(config, false);
    settings = loaded.configuration.estimator;
    simulated = campaign.head.simulated;
    if (campaign.found) {
        live = {*campaign.found, record::live_result(campaign, settings), {}};
        live->assessed = estimator::uncertainty::assess(settings, live->result);
    }
    settings = dwells::Anew::settings_of(settings, campaign.found);
    return identify(campaign, settings);
}

/// Numbers of a rig that is not the configuration's are not valid, whatever their residuals.
void contradict(estimator::uncertainty::Verdict& verdict, const std::string& contradiction) {
    if (contradiction.empty()) return;
    using estimator::uncertainty::Level;
    const std::string text = "the configuration does not fit the recording: " + contradiction;
    verdict.level = Level::not_valid;
    verdict.reasons.insert(verdict.reasons.begin(), {"configuration", text, Level::not_valid});
    verdict.sentence = "not valid, because " + text;
}

/// A folder, an HDF5 file, or the name of a campaign: then there is no such file.
bool is_campaign(const std::string& argument) {
    std::error_code error;
    return !std::filesystem::is_regular_file(argument, error)
               ? std::filesystem::is_directory(argument, error) ||
                     argument.find_first_of("/.") == std::string::npos
               : record::is_hdf5(argument);
}

std::vector<RecordingRow> read(const std::string& path) {
    Progress progress("reading " + path);
    progress.show(0, 1);
    return proto::read_recording(path);
}

struct IdentifyOptions {
    std::string recording;
    std::string config;
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
    if (options.monte_carlo && spectrum != nullptr && spectrum->several())
        throw std::runtime_error(
            "--monte-carlo: found dwells at several frequencies, expected one frequency");
    std::optional<estimator::uncertainty::MonteCarlo> drawn;
    if (options.monte_carlo) drawn = draw(identified);
    const auto* check = drawn ? &*drawn : nullptr;
    const auto* live = identified.live ? &*identified.live : nullptr;
    std::cout << (options.json ? result_json(identified.result, assessed, identified.simulated,
                                             check, live, spectrum) +
                                     "\n"
                               : simulated_line(identified.simulated) +
                                     result_table(identified.result, assessed) +
                                     (spectrum != nullptr ? spectrum_text(*spectrum) : "") +
                                     (check != nullptr ? monte_carlo_text(*check) : ""))
              << std::flush;
    return exit_status(assessed.verdict.level, options.strict);
}

}  // namespace

Identified identify_recording(const std::string& file, const std::string& config,
                              const SpectrumRequest& request) {
    Identified identified;
    Found found;
    if (is_campaign(file)) {
        found = identify_campaign(file, config, identified.settings, identified.simulated,
                                  identified.live);
    } else {
        const auto loaded = configuration::load(config, false);
        identified.settings = loaded.configuration.estimator;
        identified.simulated = loaded.configuration.simulated() || proto::says_simulated(file);
        found = identify(read(file), identified.settings, request, file);
    }
    identified.result = std::move(found.result);
    identified.assessed = estimator::uncertainty::assess(identified.settings, identified.result);
    if (identified.assessed.done && found.spectral.size() >= 2) {
        identified.spectrum = spectrum_of(identified.settings, std::move(found.spectral),
                                          std::move(found.kinds), request.form);
        adopt(*identified.spectrum, identified.settings, identified.assessed);
    }
    contradict(identified.assessed.verdict, found.contradiction);
    return identified;
}

estimator::uncertainty::MonteCarlo draw(const Identified& of) {
    Progress progress("drawing");
    const estimator::uncertainty::MonteCarloSettings how;
    return estimator::uncertainty::propagate_distributions(
        of.settings, of.result, of.assessed, how,
        [&](int blocks) { progress.show(static_cast<std::size_t>(blocks), 100); });
}

void add_identify(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<IdentifyOptions>();
    CLI::App* command = app.add_subcommand(
        "identify", "Gyro error coefficients from a recording (CSV, or HDF5 of vibrigd)");
    command
        ->add_option("FILE", options->recording,
                     "CSV with a header row and the columns time_s, run, position, alpha_deg, "
                     "beta_deg, gamma_deg, ax_g, ay_g, az_g in any order; or a recorded "
                     "campaign: its folder, HDF5 file or name")
        ->required();
    command->add_option(
        "--config", options->config,
        "configuration file (TOML); without it all defaults apply, of an HDF5 file its "
        "own");
    command
        ->add_option("--instruction-set", options->instruction_set,
                     "of the filter: auto (the best), or one of this processor's")
        ->envname("VIBRIG_INSTRUCTION_SET");
    command->add_flag("--json", options->json, "print the result as JSON");
    command
        ->add_option("--spectrum", options->spectrum,
                     "quadratic coefficients over frequency, where a recording has several "
                     "(column frequency_hz): flat, groups, resonance, or auto, which weighs them")
        ->check(CLI::IsMember({"auto", "flat", "groups", "resonance"}));
    command->add_option("--spectra", options->spectra,
                        "JSON list of {run, position, lines: [[hz, g_peak], ..]}, for a recording "
                        "without the column");
    command->add_flag("--strict", options->strict, "a doubtful result is a no as well");
    command->add_flag("--monte-carlo", options->monte_carlo,
                      "draw the declared inputs (JCGM 101) to check the combined uncertainty");
    command->footer(
        "Example: vibrig identify recording.csv --config rig.toml --json > result.json\n"
        "Exit codes: 0 the result is valid or doubtful (the verdict says why), 1 it is not valid, "
        "the configuration does not\nfit the recording (the warnings name what contradicts, and "
        "the keys suspected), or\ncoefficients are not observable (the result names them and the "
        "combinations that are "
        "determined),\nwith --strict also when it is doubtful; 2 bad usage or input.");
    command->callback(
        [options, &exit_code] { exit_code = guarded([&] { return run(*options); }); });
}

}  // namespace vibrig::tool
