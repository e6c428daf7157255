#include <stdexcept>
#include <vector>

#include "daemon/tool/analysis/level_options.hpp"
#include "daemon/tool/commands.hpp"
#include "proto/option_value.hpp"

namespace vibrig::tool::level_command {

namespace {

levelling::Gains gains_in(const std::vector<double>& list) { return {list[0], list[1], list[2]}; }

}  // namespace

levelling::LevellerSettings settings_of(const Options& options) {
    levelling::LevellerSettings loop;
    loop.earth.gravity_mps2 = options.gravity;
    loop.settling_s = options.specification.settling_s;
    loop.fast = options.gains.empty() ? levelling::design(options.specification, loop.earth).gains
                                      : gains_in(options.gains);
    if (!options.slow.empty()) {
        loop.slow = gains_in(options.slow);
    }
    loop.ramp_s = options.ramp_s;
    loop.period_s = options.period_s;
    loop.window_s = options.window_s;
    loop.tolerance_rad = options.tolerance * kRadPerArcmin;
    loop.torquer_limit = options.torquer_limit * kDegPerHour;
    loop.noise = {options.reference_noise, options.accelerometer_noise_g * options.gravity,
                  options.gyro_noise * kRadPerArcmin};  // deg/sqrt(h) is arcmin/sqrt(s)
    return loop;
}

void check_samples(const char* option, double duration_s, double period_s) {
    if (duration_s / period_s > 2e7) {
        throw std::invalid_argument(printed("%s: %g s are %g samples, expected at most 2e7", option,
                                            duration_s, duration_s / period_s));
    }
}

Json budget_json(const levelling::Leveller& loop) {
    const levelling::NoiseBudget& budget = loop.budget();
    return {{"reference_arcmin", budget.reference / kRadPerArcmin},
            {"accelerometer_arcmin", budget.accelerometer / kRadPerArcmin},
            {"gyro_arcmin", budget.gyro / kRadPerArcmin},
            {"total_arcmin", budget.total / kRadPerArcmin},
            {"dominant", budget.dominant()},
            {"mean_force_arcmin", loop.force_noise() / kRadPerArcmin}};
}

Json gains_json(const levelling::Gains& gains) {
    return {{"K1", gains.k1}, {"K2", gains.k2}, {"K3", gains.k3}};
}

std::string budget_table(const levelling::Leveller& loop) {
    const levelling::NoiseBudget& budget = loop.budget();
    return printed(
        "noise of the tilt, 1 sigma: reference %.4g', accelerometer %.4g', gyro %.4g'; "
        "together %.4g' (mostly %s); of the mean specific force %.4g'\n",
        budget.reference / kRadPerArcmin, budget.accelerometer / kRadPerArcmin,
        budget.gyro / kRadPerArcmin, budget.total / kRadPerArcmin, budget.dominant(),
        loop.force_noise() / kRadPerArcmin);
}

namespace {

constexpr double kRightAngle = 5400;  // arcmin

void add_design_options(CLI::App& command, Options& o) {
    add_numbers(command, "--tilt", o.tilt, 2, "of both channels at first, arcmin (30,-20)",
                -kRightAngle, kRightAngle);
    add_numbers(command, "--drift", o.drift, 2, "deg/h (0.1,-0.1)", -1e6, 1e6);
    add_number(command, "--settling", o.specification.settling_s, "settling time in s (100)",
               kAboveZero, 1e7);
    auto* residual = add_number(command, "--residual", o.specification.residual,
                                "fraction of the initial tilt left then (0.005)", kAboveZero, 0.99);
    auto* damping = add_number(command, "--damping", o.specification.damping, "ratio xi (0.7)",
                               kAboveZero, 0.999);
    add_numbers(command, "--gains", o.gains, 3, "K1,K2,K3 instead of a design")
        ->excludes(residual)
        ->excludes(damping);
    add_number(command, "--period", o.period_s, "s between samples (0.1)", 1e-4, 1e4);
    add_number(command, "--window", o.window_s,
               "of the means in s (1); shaker on: whole vibration periods", kAboveZero, 3600);
    add_number(command, "--tolerance", o.tolerance,
               "arcmin; default the larger of 0.05 and four times the noise of the means",
               kAboveZero, 300);
    add_number(command, "--reference-noise", o.reference_noise, "m/s per sample (0)", 0, 1000);
    add_number(command, "--accelerometer-noise", o.accelerometer_noise_g, "g per sample (1e-5)", 0,
               1);
    add_number(command, "--gyro-noise", o.gyro_noise, "random walk, deg/sqrt(h) (0)", 0, 100);
    add_number(command, "--gravity", o.gravity, "m/s^2 (9.80665)", 1, 30);
    command.add_flag("--json", o.json, "print the result as JSON");
    command.add_option("--plot", o.plot, "an SVG file, or a folder")->check(proto::charts());
}

void add_simulate_options(CLI::App& command, Options& o) {
    add_numbers(command, "--zero", o.zero_mg, 2, "of the accelerometers, mg (0,0)", -1000, 1000);
    add_numbers(command, "--reference-error", o.reference_error, 2, "constant, m/s (0,0)", -1000,
                1000);
    auto* step = add_number(command, "--step", o.step, "both channels tip by so much, arcmin",
                            -kRightAngle, kRightAngle);
    add_number(command, "--step-at", o.step_s, "when, s; --runs draws the times", 0)->needs(step);
    auto* slow = add_numbers(command, "--slow", o.slow, 3, "K1,K2,K3 to ramp to after settling");
    add_number(command, "--ramp", o.ramp_s, "length of that ramp, s (60)", kAboveZero, 1e6)
        ->needs(slow);
    add_number(command, "--torquer-limit", o.torquer_limit, "deg/h (3276.7)", kAboveZero, 1e9);
    command.add_option("--network", o.network, "fast (default), conventional, undamped")
        ->check(CLI::IsMember({"fast", "conventional", "undamped"}));
    add_number(command, "--duration", o.duration_s, "s (3.1 settling times)", kAboveZero, 1e9);
    command.add_option("--seed", o.seed, "of the noise (1)")->check(proto::whole());
    command
        .add_option("--runs", o.runs,
                    "many starts, tilt and drift drawn up to those given; exit 0 if all are "
                    "declared, 19 of 20 in the time that `level design` says + 5 %, none falsely")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000000}));
}

}  // namespace

}  // namespace vibrig::tool::level_command

namespace vibrig::tool {

void add_level(CLI::App& app, int& exit_code) {
    using namespace level_command;
    CLI::App* command = app.add_subcommand("level", "The levelling loop: gains, simulated starts");
    command->require_subcommand(1);
    command->footer("Example: vibrig level simulate --tilt 30,-20 --plot tilt.svg");
    const auto [design, to_design] = add_command<level_command::Options>(
        *command, exit_code, "design",
        "Gains from settling time, residual and damping ratio; noise budget", run_design);
    add_design_options(design, to_design);
    design.footer(
        "Example: vibrig level design --settling 600 --period 1 --reference-noise 0.2\n"
        "Method: Zha et al. 2019, eqs. 11-15.\n"
        "Exit codes: 0 done, 1 cannot settle with these figures, 2 bad usage or input.");
    const auto [simulate, to_simulate] = add_command<level_command::Options>(
        *command, exit_code, "simulate", "Starts of two channels under the loop", run_simulate);
    add_design_options(simulate, to_simulate);
    add_simulate_options(simulate, to_simulate);
    simulate.footer(
        "Example: vibrig level simulate --tilt 30,30 --step 2 --window 10 --tolerance 0.2 --runs "
        "1000\n"
        "Exit codes: 0 settled, 1 not settled, 2 bad usage or input.");
}

}  // namespace vibrig::tool
