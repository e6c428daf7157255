#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <exception>
#include <iostream>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/progress.hpp"
#include "daemon/tool/result_json.hpp"
#include "daemon/tool/result_table.hpp"
#include "estimator/identification.hpp"
#include "estimator/instruction_set.hpp"
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

estimator::Result identify(const std::vector<RecordingRow>& rows,
                           const estimator::Settings& settings) {
    const std::vector<Dwell> dwells = dwells_of(rows);
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
    estimator::Identification identification(settings, dwells.size());
    Progress progress("identifying");
    std::size_t done = 0;
    for (const auto& dwell : dwells) {
        identification.begin_dwell({dwell.order->run, dwell.order->position, dwell.order->table_g});
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i) {
            const auto& sample = campaign.samples[i];
            static_cast<void>(
                identification.add({.time_s = drivers::to_seconds(sample.time - dwell.order->from),
                                    .angle_rad = sample.angle,
                                    .force_g = sample.force,
                                    .angles_good = sample.angles_good(),
                                    .force_good = sample.force_good()}));
            if (++done % 1024 == 0) progress.show(done, campaign.samples.size());
        }
        static_cast<void>(identification.end_dwell());
    }
    return identification.result();
}

estimator::Result identify_campaign(const std::string& path, const std::string& config) {
    const record::Campaign campaign = record::read_campaign(path);
    const auto loaded =
        config.empty()
            ? configuration::parse(record::identification_sections(campaign.head.configuration),
                                   "configuration in " + campaign.path, false)
            : configuration::load(config, false);
    return identify(campaign, loaded.configuration.estimator);
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
        if (record::is_hdf5(recording)) {
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
                     "beta_deg, gamma_deg, ax_g, ay_g, az_g in any order; or a campaign's HDF5 "
                     "file")
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
