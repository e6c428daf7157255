#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>

#include "proto/durable_file.hpp"
#include "proto/option_value.hpp"
#include "tests/plant/commands.hpp"
#include "tests/plant/recording.hpp"

namespace vibrig::plant {

void add_record_command(CLI::App& app, int& exit_code) {
    struct Options {
        std::string positions = "table1";
        std::string truth;
        std::string write_truth;
        std::string write_mean;
        std::string order;
        std::string output;
        CampaignPlan plan;
        std::optional<std::uint64_t> seed;
        std::vector<std::string> sweeps;
    };
    auto o = std::make_shared<Options>();
    CLI::App* command =
        app.add_subcommand("record", "Simulate a campaign straight into a CSV recording");
    command
        ->add_option("--positions", o->positions,
                     "table1, or a CSV file with alpha_deg, beta_deg, gamma_deg")
        ->capture_default_str();
    command
        ->add_option("--table-g", o->plan.table_g,
                     "peak acceleration at the table in g, one run each")
        ->delimiter(',')
        ->check(proto::finite(0.0, 100.0))
        ->capture_default_str();
    command
        ->add_option("--frequency", o->plan.frequency_hz,
                     "of the vibration, Hz; or one for each of --table-g: a column frequency_hz")
        ->delimiter(',')
        ->check(proto::finite(1.0, 200.0))
        ->capture_default_str();
    command
        ->add_option("--profile", o->plan.profile,
                     "random vibration: the number of one of the truth's shaker.profiles, for each "
                     "of --table-g, which is its rms (to 0.1 dB) then; 0 for a sine")
        ->delimiter(',')
        ->check(CLI::Range(0, 65535));
    command
        ->add_option("--sweep", o->sweeps,
                     "FROM:TO in Hz for each of --table-g, - for none: an exponential sweep over "
                     "the dwell, its frequency in the column frequency_hz")
        ->delimiter(',');
    command->add_option("--dwell", o->plan.dwell_s, "recorded at each position, s")
        ->check(proto::finite(0.025, 1e5))
        ->capture_default_str();
    command->add_option("--ramp", o->plan.ramp_s, "of the amplitude, s")
        ->check(proto::finite(0.01, 600.0))
        ->capture_default_str();
    command->add_option("--settle", o->plan.settle_s, "after the ramp, not recorded, s")
        ->check(proto::finite(0.0, 600.0))
        ->capture_default_str();
    command->add_option("--truth", o->truth,
                        "truth file (JSON); default: Table 2 of Tang et al. 2009");
    command->add_option("--write-truth", o->write_truth, "write the truth used to this file");
    command->add_option("--write-mean", o->write_mean,
                        "write the truth with the coefficients' means over the recording, which an "
                        "identification of a rig that drifts is to be judged by");
    command->add_option("--order", o->order,
                        "dwells in their order as POSITION.RUN,..., both from 1; default: run by "
                        "run, each position once");
    command->add_option("--seed", o->seed, "of all noise; default: the truth file's, or 1")
        ->check(proto::whole());
    command->add_option("-o,--output", o->output, "CSV file to write, - for standard output")
        ->required();
    command->footer(
        "Example:\n  vibrig-plant record --table-g 9,7 --dwell 100 --seed 7 -o rec.csv\n"
        "  vibrig identify rec.csv --json > result.json && vibrig-plant judge result.json");
    command->callback([o, &exit_code] {
        Truth truth = o->truth.empty() ? Truth{} : read_truth(o->truth);
        if (o->seed) truth.seed = *o->seed;
        if (!o->write_truth.empty()) write_truth(truth, o->write_truth);
        o->plan.positions_deg = read_positions(o->positions);
        o->plan.order = parse_order(o->order);
        for (const std::string& text : o->sweeps) o->plan.sweep.push_back(parse_sweep(text));
        std::optional<proto::OutputFile> whole;
        std::ofstream file;
        if (o->output != "-") {
            whole.emplace(o->output);
            file.open(whole->place(), std::ios::binary);
        }
        std::ostream& out = o->output == "-" ? std::cout : file;
        const auto check = [&] {
            if (!out) throw PlantError(o->output + ": cannot be written: " + std::strerror(errno));
        };
        check();
        const bool terminal = isatty(STDERR_FILENO) == 1;
        Truth mean = truth;
        const std::uint64_t samples =
            record(truth, o->plan, out, &mean.coefficients, [&](std::size_t done, std::size_t all) {
                check();
                if (terminal)
                    std::fprintf(stderr, "\rdwell %zu of %zu%s", done, all,
                                 done == all ? "\n" : "");
            });
        out.flush();
        check();
        file.close();
        if (whole) whole->finish();
        if (!o->write_mean.empty()) write_truth(mean, o->write_mean);
        std::fprintf(stderr, "%llu samples, seed %llu\n", static_cast<unsigned long long>(samples),
                     static_cast<unsigned long long>(truth.seed));
        exit_code = 0;
    });
}

}  // namespace vibrig::plant
