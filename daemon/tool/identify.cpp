#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iostream>
#include <map>
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
#include "daemon/tool/progress.hpp"
#include "daemon/tool/result_json.hpp"
#include "daemon/tool/result_table.hpp"
#include "estimator/hann.hpp"
#include "estimator/identification.hpp"
#include "estimator/instruction_set.hpp"
#include "estimator/kinematics.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/plan_report.hpp"
#include "estimator/result.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

namespace {

using proto::RecordingRow;

constexpr int kResultSaysNo = 1;

struct Dwell {
    int run = 0;
    int position = 0;
    std::vector<const RecordingRow*> rows;
};

/// One dwell for each (run, position) in the order in which they begin; a pair that comes back
/// continues its dwell.
std::vector<Dwell> dwells_of(const std::vector<RecordingRow>& rows) {
    std::vector<Dwell> dwells;
    std::map<std::pair<int, int>, std::size_t> index;
    for (const RecordingRow& row : rows) {
        const auto [at, is_new] = index.try_emplace({row.run, row.position}, dwells.size());
        if (is_new) {
            dwells.push_back({row.run, row.position, {}});
        }
        dwells[at->second].rows.push_back(&row);
    }
    return dwells;
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
}

estimator::Result identify(const std::vector<RecordingRow>& rows,
                           const estimator::Settings& settings) {
    const std::vector<Dwell> dwells = dwells_of(rows);
    tell_before(dwells, settings, [](const Dwell& dwell, SeenDwell& seen) {
        for (const RecordingRow* row : dwell.rows) seen.add(measurement_of(*row));
    });
    estimator::Identification identification(settings, dwells.size());
    Progress progress("identifying");
    std::size_t done = 0;
    for (const Dwell& dwell : dwells) {
        identification.begin_dwell({dwell.run, dwell.position, -1});
        for (const RecordingRow* row : dwell.rows) {
            static_cast<void>(identification.add(measurement_of(*row)));
            // Asking a clock costs more than a filter step.
            if (++done % 1024 == 0) {
                progress.show(done, rows.size());
            }
        }
        static_cast<void>(identification.end_dwell());
    }
    return identification.result();
}

/// Of a campaign's HDF5 file the dwells as they were fed, with the levels commanded.
estimator::Result identify(const record::Campaign& campaign, const estimator::Settings& settings) {
    const auto dwells = record::recorded_dwells(campaign);
    tell_before(dwells, settings, [&](const record::RecordedDwell& dwell, SeenDwell& seen) {
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i)
            seen.add(
                rt::measurement_of(campaign.samples[i], dwell.order->from, dwell.order->zero_g));
    });
    estimator::Identification identification(settings, dwells.size());
    Progress progress("identifying");
    std::size_t done = 0;
    for (const auto& dwell : dwells) {
        record::feed(identification, campaign, dwell,
                     [&](std::size_t, const estimator::StepResult&) {
                         if (++done % 1024 == 0) progress.show(done, campaign.samples.size());
                     });
    }
    return identification.result();
}

estimator::Result identify_campaign(const std::string& path, const std::string& config) {
    record::Campaign campaign = read_named_campaign(path);
    if (!campaign.incomplete.empty()) throw std::runtime_error(campaign.incomplete);
    if (!config.empty()) record::forget_noise(campaign);
    const auto loaded =
        config.empty()
            ? configuration::parse(record::identification_sections(campaign.head.configuration),
                                   "configuration in " + campaign.path, false)
            : configuration::load(config, false);
    return identify(campaign, loaded.configuration.estimator);
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

int run(const std::string& recording, const std::string& config, const std::string& instruction_set,
        bool json) {
    estimator::Result result;
    try {
        estimator::use_instruction_set(instruction_set);
        if (is_campaign(recording)) {
            result = identify_campaign(recording, config);
        } else {
            const estimator::Settings settings =
                configuration::load(config, false).configuration.estimator;
            result = identify(read(recording), settings);
        }
    } catch (const std::exception& error) {
        // The room that found the fault named file, line, key and value already.
        std::cerr << error.what() << '\n';
        return kBadInput;
    }
    std::cout << (json ? result_json(result) + "\n" : result_table(result)) << std::flush;
    if (!std::cout) {
        std::cerr << "standard output: cannot be written\n";
        return kBadInput;
    }
    return all_observable(result) ? 0 : kResultSaysNo;
}

}  // namespace

void add_identify(CLI::App& app, int& exit_code) {
    struct Options {
        std::string recording;
        std::string config;
        std::string instruction_set = "auto";
        bool json = false;
    };
    auto options = std::make_shared<Options>();
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
    command->footer(
        "Example: vibrig identify recording.csv --config rig.toml --json > result.json\n"
        "Exit codes: 0 all 30 coefficients are determined, 1 some are not observable (the result "
        "names\nthem and the combinations that are determined), 2 bad usage or input.");
    command->callback([options, &exit_code] {
        exit_code =
            run(options->recording, options->config, options->instruction_set, options->json);
    });
}

}  // namespace vibrig::tool
