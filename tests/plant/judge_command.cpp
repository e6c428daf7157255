#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <string>

#include "proto/option_value.hpp"
#include "tests/plant/commands.hpp"
#include "tests/plant/input_file.hpp"
#include "tests/plant/judge.hpp"

namespace vibrig::plant {

void add_judge_command(CLI::App& app, int& exit_code) {
    struct Options {
        std::string result;
        std::string truth;
        double sigma = 4;
        bool json = false;
    };
    auto o = std::make_shared<Options>();
    CLI::App* command =
        app.add_subcommand("judge", "Compare an identification result with the truth");
    command
        ->add_option("result", o->result,
                     "JSON result of vibrig identify or of a campaign, - for standard input")
        ->required();
    command->add_option("--truth", o->truth,
                        "truth file (JSON); default: Table 2 of Tang et al. 2009");
    command
        ->add_option("--sigma", o->sigma,
                     "largest error in standard deviations: u_a, or sigma where there is none")
        ->check(proto::finite(0.1, 1000.0))
        ->capture_default_str();
    command->add_flag("--json", o->json, "as JSON, for machines");
    command->footer(
        "Exit code 0 only if all 30 coefficients are there, observable, finite and within the "
        "limit; 1 otherwise,\n"
        "2 for bad input.\nExample:\n  vibrig-plant judge result.json --truth truth.json --sigma "
        "4");
    command->callback([o, &exit_code] {
        const std::string text = read_input(o->result == "-" ? "/dev/stdin" : o->result,
                                            "an identification result (JSON)");
        const Truth truth = o->truth.empty() ? Truth{} : read_truth(o->truth);
        const Verdict verdict = judge(text, o->result, truth, o->sigma);
        std::cout << (o->json ? json_of(verdict) : table_of(verdict)) << std::flush;
        exit_code = verdict.passed ? 0 : 1;
    });
}

}  // namespace vibrig::plant
