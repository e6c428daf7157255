#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/plot/chart.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/design/plan_study.hpp"
#include "daemon/tool/design/plan_turntable.hpp"
#include "proto/durable_file.hpp"
#include "proto/option_value.hpp"

namespace vibrig::tool::planner {

namespace {

struct Options {
    PlanRequest request;
    std::vector<double> outer, inner, azimuth;
    std::string plot;
    std::string output;
    bool json = false;
    TurntableRequest turntable;
    bool on_turntable = false;
};

void require(bool good, const std::string& what, const std::string& expected) {
    if (!good) throw std::runtime_error(what + ", expected " + expected);
}

void check(Options& options, bool blocks) {
    PlanRequest& request = options.request;
    const std::array<std::pair<std::string, const std::vector<double>&>, 3> ranges{
        {{"--outer", options.outer}, {"--inner", options.inner}, {"--azimuth", options.azimuth}}};
    for (std::size_t k = 0; k < 3; ++k) {
        const auto& [name, range] = ranges[k];
        if (range.empty()) continue;
        request.limited[k] = true;
        request.limits.low[k] = range.front();
        request.limits.high[k] = range.back();
        require(range.front() <= range.back(),
                name + ": found " + std::to_string(range.front()) + " to " +
                    std::to_string(range.back()),
                "LOW,HIGH in deg");
    }
    require((request.survey.mount.empty() && request.survey.attitudes.empty()) ||
                request.survey.asked(),
            "found --mount or --attitude alone",
            "--frequencies, --highest, --profile, --sweeps or --about with it");
    require(!blocks || request.order == "random", "found --block with --order " + request.order,
            "--order random with it");
    require(request.evaluate.empty() || (request.runs == 0 && request.targets.empty()),
            "found --evaluate with --runs or --targets", "one of them");
}

/// `blocks`: somebody asked for their size.
int run(Options& options, bool blocks) {
    PlanStudy result;
    check(options, blocks);
    {
        const Working working("planning");
        result =
            options.request.survey.asked() ? survey_study(options.request) : study(options.request);
    }
    if (!options.output.empty()) proto::write_output(options.output, plan_json(result) + "\n");
    if (!options.plot.empty())
        plot::write_pictures(options.plot,
                             {{"sphere", plan_picture(result, frame_of(options.request))}});
    std::cout << (options.json ? plan_json(result) + "\n" : plan_table(result)) << std::flush;
    if (!std::cout) return 0;  // reported by guarded()
    if (!result.refusal.empty()) {
        std::cerr << "refused: " << result.refusal << '\n';
        return kNo;
    }
    return result.beyond_limits ? kNo : 0;
}

int run_turntable(Options& options) {
    if (!options.plot.empty())
        throw std::runtime_error("found --plot with --turntable, expected -o");
    TurntableRequest& request = options.turntable;
    request.runs = options.request.runs;
    request.without = options.request.without;
    request.seed = options.request.seed;
    const TurntablePlan plan = turntable_plan(request);
    if (!options.output.empty()) proto::write_output(options.output, turntable_csv(plan));
    std::cout << (options.json ? turntable_json(plan) + "\n" : turntable_table(plan));
    if (plan.refusal.empty()) return 0;
    std::cerr << "refused: " << plan.refusal << '\n';
    return kNo;
}

void add_turntable(CLI::App& command, Options& options) {
    CLI::Option* turntable = command.add_flag(
        "--turntable", options.on_turntable,
        "a plan for a turntable or centrifuge instead of the rig: inputs on spheres, for vibrig "
        "calibrate (-o: CSV to be filled in)");
    add_numbers(command, "--spheres", options.turntable.spheres, 0,
                "with --turntable: radii, g or deg/s (1,2)", kAboveZero, 1e6)
        ->needs(turntable);
    command
        .add_option(
            "--allocation", options.turntable.allocation,
            "with --turntable: free (default, D-optimal), or [6]8 + [8]6 as both, split-68, "
            "split-86")
        ->needs(turntable)
        ->check(CLI::IsMember({"free", "both", "split-68", "split-86"}));
    for (const char* of_the_rig :
         {"--positions",   "--levels",     "--grid",        "--evaluate",  "--done",
          "--targets",     "--config",     "--frequencies", "--highest",   "--mount",
          "--profile",     "--attitude",   "--sweeps",      "--sweep-s",   "--about",
          "--outer",       "--inner",      "--azimuth",     "--forbidden", "--forbidden-within",
          "--noise-per-g", "--time-costs", "--dwell",       "--settle",    "--ramp",
          "--slew",        "--order",      "--block"}) {
        turntable->excludes(command.get_option(of_the_rig));
    }
}

void add_candidates(CLI::App& command, Options& options) {
    PlanRequest& request = options.request;
    command.add_option("--positions", request.positions,
                       "CSV with alpha_deg, beta_deg, gamma_deg: the candidates; without --runs "
                       "the list itself is judged (default: the 26 directions of the cube)");
    add_numbers(command, "--levels", request.levels_g, 0,
                "peak acceleration at the platform, g (0,2,4,4.667,6)", 0, 1e3);
    add_number(command, "--grid", request.grid_deg, "candidates every so many deg of each gimbal",
               5, 90)
        ->excludes(command.get_option("--positions"));
    for (const auto& [name, range] :
         {std::pair{"--outer", &options.outer}, std::pair{"--inner", &options.inner},
          std::pair{"--azimuth", &options.azimuth}}) {
        add_numbers(command, name, *range, 2,
                    "gimbal limits LOW,HIGH as the encoders count, deg (gimbal.travel_deg)");
    }
    CLI::Option* const forbidden =
        command.add_option("--forbidden", request.forbidden, "CSV of positions to keep away from");
    add_number(command, "--forbidden-within", request.limits.forbidden_within,
               "largest difference of the three angles that counts as near, deg (10)", 0, 360)
        ->needs(forbidden);
    add_number(command, "--noise-per-g", request.noise_per_g,
               "noise grows with the level as hypot(1, this x level) (0)", 0, 1e3);
    command.add_option("--without", request.without, "terms the model has not, such as D12,D13")
        ->delimiter(',');
}

void add_survey(CLI::App& command, Options& options) {
    SurveyRequest& survey = options.request.survey;
    add_numbers(command, "--frequencies", survey.frequencies, 0,
                "a survey over frequency: Hz, the first one with all positions "
                "(vibration.frequency_hz); moved off those that sampling forbids",
                1, 20'000);
    add_number(command, "--highest", survey.highest_hz,
               "further frequencies at even ratios up to here, Hz (the profile's highest)", 1,
               20'000);
    command
        .add_option("--mount", survey.mount,
                    "isolated, or hard: the platform bolted to the table (spectrum.mount)")
        ->check(CLI::IsMember({"isolated", "hard"}));
    CLI::Option* const profile =
        command.add_option("--profile", survey.profile,
                           "positions for the drift under this profile: a JSON file, or a name of "
                           "vibrig predict --list or of a [[profile]] of the configuration");
    command
        .add_option("--attitude", survey.attitudes,
                    "with --profile: ALPHA,BETA,GAMMA of the gimbals, deg; again for more (the "
                    "positions)")
        ->allow_extra_args(false)
        ->needs(profile);
    CLI::Option* sweeps =
        add_numbers(command, "--sweeps", survey.sweeps, 2,
                    "LOW,HIGH in Hz: sweeps between them first, up and down, at the three "
                    "positions that see most of all six quadratic coefficients",
                    0.1, 20'000);
    add_number(command, "--sweep-s", survey.sweep_s, "s of each sweep (300)", 10, 86'400)
        ->needs(sweeps);
    command
        .add_option("--about", survey.about,
                    "JSON of vibrig identify, or result.json of vibrigd: frequencies below and "
                    "above the resonances it names, each where it shows most")
        ->excludes(command.get_option("--highest"));
}

void add_time(CLI::App& command, Options& options) {
    PlanRequest& request = options.request;
    command.add_flag("--time-costs", request.time_costs,
                     "compare plans per time, ramps included, not per run");
    add_number(command, "--dwell", request.dwell_s, "s of one run (100)", kAboveZero, 1e6);
    add_number(command, "--settle", request.settle_s, "s after the ramp (3)", kAboveZero, 1e6);
    add_number(command, "--ramp", request.ramp_s, "s to the level, and back (2)", kAboveZero, 1e6);
    add_number(command, "--slew", request.slew_deg_per_s, "deg/s of the gimbals (5)", kAboveZero,
               1e6);
    command
        .add_option(
            "--order", request.order,
            "travel (default; of a list or plan that is judged: list): little gimbal travel; "
            "balanced: no slow change of a bias looks like a coefficient; random: in blocks; list")
        ->check(CLI::IsMember({"travel", "balanced", "random", "list"}));
    command.add_option("--block", request.block, "runs in a block of --order random (8)")
        ->check(CLI::Range(std::size_t{1}, std::size_t{10000}));
}

}  // namespace

}  // namespace vibrig::tool::planner

namespace vibrig::tool {

void add_plan(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<planner::Options>();
    planner::PlanRequest& request = options->request;
    CLI::App* command = app.add_subcommand("plan", "D-optimal test plans: positions and levels");
    planner::add_candidates(*command, *options);
    command
        ->add_option("--runs", request.runs, "size of the exact plan (14); with --targets: at most")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000}));
    command->add_option("--evaluate", request.evaluate,
                        "judge this plan: JSON as printed here, or CSV with alpha_deg, beta_deg, "
                        "gamma_deg, level_g, count");
    command->add_option("--done", request.done, "plan file of runs that are measured already");
    add_numbers(*command, "--targets", request.targets, 3,
                "as few runs as reach these standard errors: bias, linear, quadratic (deg/h, "
                "deg/h/g, deg/h/g^2; 0: any)",
                0);
    planner::add_time(*command, *options);
    planner::add_survey(*command, *options);
    command->add_option("--seed", request.seed, "of the random starts (1)")->check(proto::whole());
    command->add_option("--config", request.config, "configuration file (TOML) of the rig");
    command->add_option("-o,--output", options->output, "plan file for vibrigd ([campaign] plan)");
    command->add_option("--plot", options->plot, "an SVG file, or a folder: the directions")
        ->check(proto::charts());
    command->add_flag("--json", options->json, "print the plan as JSON");
    planner::add_turntable(*command, *options);
    command->footer(
        "Examples: vibrig plan --runs 20 --levels 0,6 -o plan.json --plot sphere.svg\n"
        "          vibrig plan --frequencies 15,25,35 --highest 125 --mount hard -o survey.json\n"
        "          vibrig plan --sweeps 20,120 --frequencies 15 --config rig.toml -o sweeps.json\n"
        "          vibrig plan --about result.json --config rig.toml -o about.json\n"
        "          vibrig plan --turntable --spheres 1,8 --runs 40 -o turntable.csv\n"
        "Exit codes: 0 done, 1 the plan does not determine all coefficients, misses its targets or "
        "asks for\nmore than the shaker's usual limits, 2 bad usage or input, a level beyond the "
        "limits "
        "that --config states\namong it.");
    // A survey takes the positions as they are listed.
    for (const char* other :
         {"--evaluate", "--done", "--targets", "--grid", "--time-costs", "--outer", "--inner",
          "--azimuth", "--forbidden", "--forbidden-within"}) {
        for (const char* survey :
             {"--frequencies", "--highest", "--profile", "--sweeps", "--about"})
            command->get_option(other)->excludes(command->get_option(survey));
    }
    const CLI::Option* order = command->get_option("--order");
    const CLI::Option* block = command->get_option("--block");
    command->callback([options, order, block, &exit_code] {
        options->request.ordered = order->count() > 0;
        if (options->request.survey.asked() && order->count() == 0)
            options->request.order = "balanced";
        exit_code = guarded([&] {
            return options->on_turntable ? planner::run_turntable(*options)
                                         : planner::run(*options, block->count() > 0);
        });
    });
}

}  // namespace vibrig::tool
